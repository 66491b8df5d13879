"""Every STOP by anybody who may stop is obeyed, and two clients keep their slots.

The machine runs the real application in virtual time, with small limits. The last check presses
STOP on a real server with real sockets, while a greedy client floods the server from a separate
process.
"""

from __future__ import annotations

import contextlib
import subprocess
import sys
from pathlib import Path
from typing import Any

import httpx
import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect as real_connect

from robot.clock import RealClock
from server.access.config import NetworkConfig, NetworkLimits
from server.access.pairing import Pairing
from server.gateway.roles import Role
from tests.kit.sizes import size
from tests.kit.wait import wait_until
from tests.server.access.unpaired_flood import PATIENCE_S

from .lan_process import lan_process
from .live_robot import WEB
from .virtual_connections import VirtualSocket
from .virtual_server import VirtualServer, connect

LIMITS = NetworkLimits(
    clients=6,
    clients_each=3,
    requests_burst=8,
    requests_per_second=2,
    messages_burst=10,
    messages_per_second=5,
    refused_before_closing=20,
)
PEOPLE = ("owner", "pilot", "viewer", "pupil", "greedy")
TRIES = size("STOPS", 3, 250)
"""Number of STOPs of each of two clients, by each of two ways (`.ci/run`: 250)."""
OBEYED_S = 0.3
person_st = st.sampled_from(PEOPLE)
_DRIVE = '{"type":"drive","held":"left","frame":null,"seq":1'
WORDS = ('{"type":"ping","client_ms":1}', _DRIVE + "}", _DRIVE + ',"steering":-0.6,"throttle":0.4}')
"""A ping, and drive messages with and without proportional steering."""


class PeopleAtOneRobot(RuleBasedStateMachine):
    """An owner, a pilot of a class, a viewer, and two clients that act at random."""

    def __init__(self) -> None:
        super().__init__()
        self.pairing = Pairing(1000)
        config = NetworkConfig(port=0, web=WEB, lan=True, limits=LIMITS)
        self.server = VirtualServer(config, pairing=self.pairing).__enter__()
        self.sockets: dict[str, list[VirtualSocket]] = {person: [] for person in PEOPLE}
        self.cookies = {person: self._pair(Role.PILOT) for person in ("owner", "viewer")}
        self.cookies["viewer"] = self._pair(Role.VIEWER)
        for person in ("pilot", "pupil", "greedy"):
            self.cookies[person] = self._redeem(self._invitation())
        self._open("pilot")
        self.server.wait_until(lambda: bool(self.server.hub.pilot), what="the pilot's wheel")

    def teardown(self) -> None:
        self.server.__exit__(None, None, None)

    @rule(person=person_st, times=st.integers(1, 5))
    def open_pages(self, person: str, times: int) -> None:
        for _ in range(times):
            self._open(person)

    @rule(person=person_st, times=st.sampled_from([1, 5, 30]))
    def ask(self, person: str, times: int) -> None:
        for _ in range(times):
            httpx.get(self.server.address + "/healthz", headers=self.cookies[person])

    @rule(
        person=person_st,
        words=st.sampled_from(WORDS),
        times=st.sampled_from([1, 30, 60]),
        stop=st.booleans(),
    )
    def send_a_burst(self, person: str, words: str, times: int, stop: bool) -> None:
        for socket in self._open_sockets(person)[-1:]:
            burst = [words] * times
            self._send(socket, [*burst, '{"type":"stop"}'] if stop else burst)
            if stop:
                self._is_obeyed(f"{person}'s, {times} of {words} before it")

    @rule(person=st.sampled_from(("viewer", "pupil", "greedy")), times=st.sampled_from([1, 70]))
    def redeem_again(self, person: str, times: int) -> None:
        """Redeem with a browser, which has one session, or as if from many browsers."""
        token = self._invitation()
        before = dict(self.cookies)
        self.cookies[person] = self._redeem(token, before[person])
        for _ in range(times):
            self._redeem(token)

    @rule(times=st.sampled_from([1, 70]), role=st.sampled_from((Role.PILOT, Role.VIEWER)))
    def pair_at_the_terminal(self, times: int, role: Role) -> None:
        for _ in range(times):
            self._pair(role)

    @rule(person=person_st)
    def close_a_page(self, person: str) -> None:
        for socket in self._open_sockets(person)[:1]:
            self.sockets[person].remove(socket)
            socket.close()

    @rule(seconds=st.floats(0.0, 3.0))
    def wait(self, seconds: float) -> None:
        self.server.forward(seconds)

    @rule(person=st.sampled_from(("owner", "pilot", "greedy")), by_page=st.booleans())
    def stop(self, person: str, by_page: bool) -> None:
        """A page sends STOP on its websocket, or by a request if it has none."""
        sockets = self._open_sockets(person)
        if by_page and sockets:
            self._send(sockets[-1], ['{"type":"stop"}'])
        else:
            answer = httpx.post(
                self.server.address + "/api/stop", headers=self.cookies[person], timeout=60
            )
            if person == "greedy" and answer.status_code == 401:
                return  # newer sessions of the same person have evicted it
            assert answer.status_code == 200, f"the {person}'s STOP: {answer.status_code}"
        self._is_obeyed(f"the {person}'s")

    @rule(person=st.sampled_from(("owner", "pilot")))
    def come_back(self, person: str) -> None:
        for socket in list(self._open_sockets(person)):
            self.sockets[person].remove(socket)
            socket.close()
        self.server.forward(1.0)  # at most one request in this time is allowed, for any client
        assert self._open(person), f"the {person} cannot come back"

    @precondition(lambda self: self.server.hub.broadcast.clients)
    @invariant()
    def places_are_counted(self) -> None:
        assert self.server.services.gateway.admission.sockets.taken <= LIMITS.clients

    def _is_obeyed(self, whose: str) -> None:
        loop = self.server.rig.loop
        self.server.wait_until(lambda: loop.state.emergency, OBEYED_S, f"STOP, {whose}")
        loop.release_emergency()
        self.server.wait_until(lambda: not loop.state.emergency)

    def _open(self, person: str) -> bool:
        headers = self.cookies[person]
        try:
            socket = connect(self.server.ws("/ws/drive"), additional_headers=headers)
        except InvalidStatus:
            return False
        self.sockets[person].append(socket)
        return True

    def _open_sockets(self, person: str) -> list[VirtualSocket]:
        self.sockets[person] = [one for one in self.sockets[person] if one.close_code is None]
        return self.sockets[person]

    def _send(self, socket: VirtualSocket, texts: list[str]) -> None:
        async def send() -> None:  # all at once
            for text in texts:
                socket._socket.send(text)

        try:
            self.server.run(send())
        except ConnectionClosed:
            return

    def _invitation(self) -> str:
        return self.pairing.invite(self.server.clock.now_s())[0]

    def _pair(self, role: Role) -> dict[str, str]:
        return self._redeem(self.pairing.tokens[role])

    def _redeem(self, token: str, before: dict[str, str] | None = None) -> dict[str, str]:
        """Redeem like the server's route; its own rate limit is not tested here."""
        name = "drivelesson-0"
        secret = (before or {}).get("cookie", "").partition("=")[2]
        paired: Any = self.pairing.redeem(token, self.server.clock.now_s(), "", secret)
        return {"cookie": f"{name}={getattr(paired, 'secret', secret)}"}


TestPeopleAtOneRobot = PeopleAtOneRobot.TestCase
TestPeopleAtOneRobot.settings = settings(
    deadline=None,
    max_examples=max(5, TRIES // 2),
    stateful_step_count=20,
    suppress_health_check=[HealthCheck.too_slow],
)


def check_who_takes_all_places_holds_up_no_stop(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    took_ms: list[float] = []
    clock = RealClock()
    with lan_process(tmp_path / "log") as server:
        cookies = {person: server.pair() for person in ("owner", "pilot")}
        url = f"ws://127.0.0.1:{server.port}/ws/drive"
        words = [sys.executable, "-m", "tests.server.greedy", str(server.port)]
        theirs = [server.pair(role) for role in ("viewer", "pilot")]
        greedy = [subprocess.Popen([*words, cookie]) for cookie in theirs]
        try:
            while server.ask()["evicted"] < 100:
                clock.sleep(0.1)
            for number in range(4 * TRIES):
                cookie = {"Cookie": cookies["owner" if number % 2 else "pilot"]}
                with contextlib.ExitStack() as stack:
                    # On a separate connection; making a client of httpx takes 20 ms.
                    if number % 4 < 2:
                        asker = stack.enter_context(httpx.Client(timeout=PATIENCE_S))
                        start_s = clock.now_s()
                        answer = asker.post(server.address + "/api/stop", headers=cookie)
                        assert answer.status_code == 200
                    else:  # behind all messages that its socket accepts, just reconnected
                        options: Any = {"additional_headers": cookie, "open_timeout": PATIENCE_S}
                        options |= {"compression": None, "max_queue": None, "close_timeout": 0}
                        page = stack.enter_context(real_connect(url, **options))
                        start_s = clock.now_s()
                        for _ in range(700):
                            page.send('{"type":"ping","client_ms":1}')
                        page.send('{"type":"stop"}')
                    wait_until(lambda: server.ask()["emergency"], f"try {number}", PATIENCE_S)
                    took_ms.append(1000 * (clock.now_s() - start_s))
                assert not server.ask("release")["emergency"]
        finally:
            for process in greedy:
                process.kill()
                process.wait()
    took_ms.sort()
    with capsys.disabled():
        print(
            f"\nSTOP: {len(took_ms)} of {4 * TRIES}; median {took_ms[len(took_ms) // 2]:.0f} ms, "
            f"99 % {took_ms[int(0.99 * len(took_ms))]:.0f} ms, longest {took_ms[-1]:.0f} ms"
        )
