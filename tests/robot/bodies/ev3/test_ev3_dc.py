"""The third-party client `ev3-dc` checks the stand-in, and its bytes are compared with ours.

It is GPLv3 and not a dependency: CI installs it only for this test, into var/ev3-dc.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

from robot.bodies.ev3.stock import codec
from robot.bodies.ev3.stock.lines import BEACON_PORT
from tests.kit.needed import ROOT, installed
from tests.standins.ev3_stock import StockBrick


@pytest.mark.realtime
def test_a_foreign_client_drives_the_stand_in_and_sends_what_we_send() -> None:
    client = installed("ev3-dc", "ev3_dc")
    with StockBrick(BEACON_PORT) as brick:
        told = subprocess.Popen(
            [
                sys.executable,
                str(ROOT / "tests/robot/bodies/ev3/foreign_client.py"),
                "00:16:53:3F:0C:1E",
            ],
            env={**os.environ, "PYTHONPATH": str(client)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert told.stdout is not None and told.stdin is not None
        with told:
            encodings = json.loads(told.stdout.readline())
            for value, code in encodings["numbers"].items():
                assert codec.number(int(value)).hex() == code, value
            for index, code in encodings["results"].items():
                assert codec.result(int(index)).hex() == code, index
            assert json.loads(told.stdout.readline()) == {"moving": True}
            assert [motor.percent for motor in brick.motors] == [0, 34, 34, 0]
            assert json.loads(told.stdout.readline()) == {"moving": False}
            assert not brick.is_moving, "the brick ended the move by itself"
            told.stdin.write("\n")
            told.stdin.flush()
            sensed = json.loads(told.stdout.readline())
            assert sensed == {"touch": 0.0, "cm": 42.0, "percent": 80}
        assert told.returncode == 0
        assert [motor.percent for motor in brick.motors] == [0, 0, 0, 0]
    codes = [message[7:] for message in brick.messages]
    assert codec.timed_speed(6, 34, 450) in codes
    assert codec.stop(6) in codes
    sensors = codec.sensor(0, codec.TOUCH, 0) + codec.sensor(3, codec.ULTRASONIC, 4)
    assert sensors + codec.battery(8) in codes
