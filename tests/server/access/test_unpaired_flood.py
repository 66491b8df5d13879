"""A flood from an unpaired program locks nobody out while a paired pilot drives."""

import contextlib
import subprocess
import sys
from typing import Any

import httpx
import pytest
from websockets.exceptions import WebSocketException

from robot.clock import RealClock
from tests.kit.wait import wait_until
from tests.server.access.unpaired_flood import HALF_REQUESTS, IDLE, PATIENCE_S, WRONG_TOKENS
from tests.server.lan_process import Process, lan_process
from tests.server.live_robot import Pilot
from tests.server.test_stop_always import check_who_takes_all_places_holds_up_no_stop

pytestmark = pytest.mark.realtime

MOST_LOG_BYTES = 100_000


@pytest.mark.timeout(900)
def test_a_flood_neither_stops_the_pilot_nor_locks_out_a_new_phone(capsys, tmp_path):
    (tmp_path / "greedy").mkdir()
    check_who_takes_all_places_holds_up_no_stop(tmp_path / "greedy", capsys)
    log = tmp_path / "log"
    with lan_process(log) as server:
        the_right_token_is_admitted_whoever_tried_wrong_ones(server)
        a_pilot_drives_and_another_phone_comes_in_the_middle_of_a_flood(server, capsys)
    assert log.stat().st_size < MOST_LOG_BYTES, log.read_text()[-2000:]


def the_right_token_is_admitted_whoever_tried_wrong_ones(server: Process) -> None:
    url, wrong = server.address + "/api/pair", {"token": "WRONG"}
    with httpx.Client(timeout=PATIENCE_S) as client:  # making one takes long if the machine is busy
        statuses = [client.post(url, json=wrong).status_code for _ in range(WRONG_TOKENS)]
    assert statuses[0] == 403 and statuses[-1] == 429
    assert server.pair()


def a_pilot_drives_and_another_phone_comes_in_the_middle_of_a_flood(
    server: Process, capsys: pytest.CaptureFixture[str]
) -> None:
    def page(cookie: str, *, sees: bool = False) -> Pilot:
        url = f"ws://127.0.0.1:{server.port}/ws/drive"
        options: Any = {"additional_headers": {"Cookie": cookie}, "open_timeout": PATIENCE_S}
        return Pilot(url, sees=sees, **options)

    clock, came_s = RealClock(), list[float]()
    attack = [sys.executable, "-m", "tests.server.access.unpaired_flood", server.address]
    with page(server.pair(), sees=True) as pilot:
        pilot.drive_until(lambda: pilot.state["mode"] == "train")
        flood = subprocess.Popen(attack, stdout=subprocess.PIPE, text=True)
        wait_until(lambda: server.ask()["evicted"] >= 100, "the flood", PATIENCE_S)
        before, cookie = len(pilot.messages), server.pair()
        while flood.poll() is None:
            clock.sleep(0.25)  # as a page waits before it connects again
            begun_s = clock.now_s()
            with contextlib.suppress(OSError, WebSocketException), page(cookie) as phone:
                phone.wait_for(lambda m: m["type"] == "state", PATIENCE_S)
                came_s.append(clock.now_s() - begun_s)
            if pilot.state["mode"] != "train":  # a busy machine stopped the robot
                pilot.mode("train")
        n_ended = int(flood.communicate()[0])
        modes = [message.get("mode") for message in pilot.messages[before:]]
        assert modes.count("train") > 20, "it was stopped as long as the attack lasted"
        pilot.drive_until(lambda: pilot.state["mode"] == "train")
        pilot.send(type="ping", client_ms=1)
        pilot.wait_for(lambda m: m["type"] == "pong")  # the pilot's connection was never cut
    assert came_s, "no phone came while the attack lasted"
    assert n_ended > 0.9 * (HALF_REQUESTS + IDLE), "pending connections are not closed"
    with capsys.disabled():
        print(f"\nflood: {server.ask()}, came in {[round(1000 * s) for s in came_s]} ms")
