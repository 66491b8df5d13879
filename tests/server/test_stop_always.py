"""Every STOP by a client with the right to stop is obeyed, and owner and pilot keep their slots.

The state machine runs the real application in virtual time, with small limits.
access/test_unpaired_flood.py presses STOP on real sockets, while others flood the server.
"""

from typing import Any

import httpx
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule
from websockets.exceptions import ConnectionClosed, InvalidStatus

from server.access.config import NetworkConfig, NetworkLimits
from server.access.pairing import Pairing
from server.gateway.roles import Role
from tests.kit.sizes import size

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
        """Redeem tokens with one browser, which has one session, or as if from many browsers."""
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
                return  # newer sessions of this person have evicted the session
            assert answer.status_code == 200, f"the {person}'s STOP: {answer.status_code}"
        self._is_obeyed(f"the {person}'s")

    @rule(person=st.sampled_from(("owner", "pilot")))
    def come_back(self, person: str) -> None:
        for socket in list(self._open_sockets(person)):
            self.sockets[person].remove(socket)
            socket.close()
        self.server.forward(1.0)  # so that the rate limit admits the next request
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
        async def send() -> None:  # all messages at once
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
    max_examples=size("STOP_RUNS", 5, 125),
    stateful_step_count=20,
    suppress_health_check=[HealthCheck.too_slow],
)
