"""Faults that need a server in a separate process."""

from __future__ import annotations

import os
import signal
import time

import pytest

from robot.driver import ACTION_TIMEOUT_S
from server.lab.bench.subject import ServerUnderTest
from tests.server.live_robot import Pilot

pytestmark = [pytest.mark.slow, pytest.mark.realtime]


def test_a_frozen_server_lets_the_body_stop_and_does_not_move_it_again() -> None:
    """Every driver's tests show that the body itself ends each move after `ACTION_TIMEOUT_S`.

    This test only has to show that no move is sent after the freeze.
    """
    assert ACTION_TIMEOUT_S <= 0.5
    with ServerUnderTest("drivelesson", 30.0) as subject, _pilot(subject.port) as pilot:
        for mode in ("train", "autonomous"):
            pilot.drive_until(lambda: pilot.state["action"] == "forward", mode=mode)
            os.kill(subject.pid, signal.SIGSTOP)
            time.sleep(1.0)  # the pilot keeps holding, and its messages pile up
            resumed_s = time.monotonic()
            os.kill(subject.pid, signal.SIGCONT)
            pilot.wait_for_state(mode="stopped")
            time.sleep(0.2)
            notes = subject.ask()
            assert notes["moved_s"] < resumed_s, "a move was sent after the freeze"
            assert notes["mode"] == "stopped"
            # the loop's late tick or the waiting messages stop the robot, whichever comes first
            assert notes["stop_reason"] in ("loop_fault", "link_slow")


def _pilot(port: int) -> Pilot:
    return Pilot(f"ws://127.0.0.1:{port}/ws/drive")
