"""A flood by a paired or unpaired program locks nobody out and delays no STOP."""

import contextlib
import subprocess
import sys
from typing import Any

import httpx
import pytest
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

from robot.clock import RealClock
from tests.kit.sizes import size
from tests.kit.wait import wait_until
from tests.server.access.floods import HALF_REQUESTS, IDLE, PATIENCE_S
from tests.server.lan_process import Process, lan_process
from tests.server.live_robot import Pilot

TRIES = size("STOPS", 3, 250)
"""Number of STOPs by each of two clients, in each of two ways (250 at full size)."""
CONNECTS = size("CONNECTS", 300, 5_000)
MOST_LOG_BYTES = 100_000
FLOOD = [sys.executable, "-m", "tests.server.access.floods"]


@pytest.mark.realtime
@pytest.mark.timeout(900)
def test_a_flood_neither_stops_the_pilot_nor_locks_out_a_new_phone(capsys, tmp_path):
    log = tmp_path / "log"
    with lan_process(log) as server:
        a_client_that_takes_all_slots_delays_no_stop(server, capsys)
        logged = log.stat().st_size
        a_pilot_drives_and_a_new_phone_is_served_during_a_flood(server, capsys)
    assert log.stat().st_size - logged < MOST_LOG_BYTES, log.read_text()[-2000:]


def a_client_that_takes_all_slots_delays_no_stop(
    server: Process, capsys: pytest.CaptureFixture[str]
) -> None:
    took_ms, clock = list[float](), RealClock()
    cookies = {person: server.pair() for person in ("owner", "pilot")}
    theirs = [server.pair(role) for role in ("viewer", "pilot")]
    greedy = [subprocess.Popen([*FLOOD, "paired", str(server.port), cookie]) for cookie in theirs]
    try:
        wait_until(lambda: server.ask()["evicted"] >= 100, "the flood", PATIENCE_S)
        for number in range(4 * TRIES):
            cookie = {"Cookie": cookies["owner" if number % 2 else "pilot"]}
            with contextlib.ExitStack() as stack:
                # A new connection; the time excludes making the client, which takes 20 ms.
                if number % 4 < 2:
                    asker = stack.enter_context(httpx.Client(timeout=PATIENCE_S))
                    start_s = clock.now_s()
                    answer = asker.post(server.address + "/api/stop", headers=cookie)
                    assert answer.status_code == 200
                else:  # on a new websocket, after as many messages as it accepts
                    options: Any = {"additional_headers": cookie, "open_timeout": PATIENCE_S}
                    options |= {"compression": None, "max_queue": None, "close_timeout": 0}
                    page = stack.enter_context(connect(server.drive_url, **options))
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


def a_pilot_drives_and_a_new_phone_is_served_during_a_flood(
    server: Process, capsys: pytest.CaptureFixture[str]
) -> None:
    def page(cookie: str, *, sees: bool = False) -> Pilot:
        options: Any = {"additional_headers": {"Cookie": cookie}, "open_timeout": PATIENCE_S}
        return Pilot(server.drive_url, sees=sees, **options)

    clock, came_s, earlier = RealClock(), list[float](), server.ask()["evicted"]
    with page(server.pair(), sees=True) as pilot:
        pilot.drive_until(lambda: pilot.state["mode"] == "train")
        attack = [*FLOOD, "unpaired", str(server.port), str(CONNECTS)]
        flood = subprocess.Popen(attack, stdout=subprocess.PIPE, text=True)
        wait_until(lambda: server.ask()["evicted"] >= earlier + 100, "the flood", PATIENCE_S)
        before, cookie = len(pilot.messages), server.pair()
        while flood.poll() is None:
            clock.sleep(0.25)  # like a page that waits before it reconnects
            begun_s = clock.now_s()
            with contextlib.suppress(OSError, WebSocketException), page(cookie) as phone:
                phone.wait_for(lambda m: m["type"] == "state", PATIENCE_S)
                came_s.append(clock.now_s() - begun_s)
            if pilot.state["mode"] != "train":  # a busy machine stopped the robot
                pilot.mode("train")
        n_ended = int(flood.communicate()[0])
        modes = [message.get("mode") for message in pilot.messages[before:]]
        assert modes.count("train") > 20, "the robot could not drive during the attack"
        pilot.drive_until(lambda: pilot.state["mode"] == "train")
        pilot.send(type="ping", client_ms=1)
        pilot.wait_for(lambda m: m["type"] == "pong")  # the pilot's connection was not cut
    assert came_s, "no phone was served during the attack"
    assert n_ended > 0.9 * (HALF_REQUESTS + IDLE), "pending connections were not closed"
    with capsys.disabled():
        print(f"\nflood: {server.ask()}; phones served in {[round(1000 * s) for s in came_s]} ms")
