"""`drivelesson brick doctor`: its findings and advice for bricks in every state."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

from robot.bodies.ev3 import examination
from robot.bodies.ev3.agent.inspection import inspect_brick
from robot.bodies.ev3.doctor import BrickFacts, Finding, Level, WheelTurn, examine, write_report
from robot.bodies.ev3.examination import WHEEL_TEST, measure
from robot.bodies.ev3.fake_agent import FakeCameraReader, inspect_as_ev3
from robot.bodies.ev3.fake_brick import FakeBrick
from robot.bodies.ev3.link import RemotePicture
from robot.bodies.ev3.remote_driver import Ev3RemoteDriver, Ev3RemoteOptions
from server.__main__ import main
from server.bodies import brick as command
from tests.kit.needed import ROOT
from tests.robot.bodies.ev3.virtual_agent import ADDRESS, VirtualAgent

GUIDE = ROOT / "docs/howto/ev3.md"


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(examination, "WHEEL_PART_S", 0.6)
    monkeypatch.setattr(examination, "ROLL_OUT_S", 0.05)
    monkeypatch.setattr(examination, "PICTURES_S", 1.5)


def pictures(n: int = 40, period_s: float = 0.1, age_s: float = 0.12) -> list[RemotePicture]:
    shape = {"width": 160, "height": 120, "encoding": "yuyv"}
    return [
        RemotePicture(data=b"", taken_s=came_s - age_s, came_s=came_s, **shape)
        for came_s in (period_s * k for k in range(n))
    ]


SOUND_WHEELS = [
    WheelTurn(asked_dps=(180 * left, 180 * right), turned_dps=(176 * left, 176 * right))
    for left, right in WHEEL_TEST
]
MOTORS = [
    {"driver_name": "lego-ev3-l-motor", "address": f"ev3-ports:{port}"} for port in ("outB", "outC")
]
INSPECTED: dict[str, Any] = {
    "release": "0.1.0 12345678",
    "python": "3.5.3",
    "kernel": "4.14.117",
    "machine": "armv5tejl",
    "clock_s": 0.0,
    "motors": MOTORS,
    "sensors": [{"driver_name": "lego-ev3-us", "address": "ev3-ports:in4"}],
    "battery_v": 7.6,
    "memory_mb": 31.0,
    "card_mb": 2500.0,
    "cameras": [{"device": "/dev/video0", "offers": {"YUYV": ["160x120"]}}],
}
SOUND = BrickFacts(
    address="192.168.1.7:8765",
    ports=("outB", "outC"),
    release="0.1.0 12345678",
    inspected=INSPECTED,
    round_trips_s=[0.006] * 20,
    clock_ahead_s=0.4,
    pictures=pictures(),
    wheels=SOUND_WHEELS,
)


def inspected(**changed: Any) -> BrickFacts:
    return replace(SOUND, inspected={**INSPECTED, **changed})


def camera(**told: Any) -> BrickFacts:
    return inspected(cameras=[{"device": "/dev/video0", **told}])


def wheels(index: int, turned: tuple[float, float], **rest: Any) -> BrickFacts:
    changed = list(SOUND_WHEELS)
    changed[index] = replace(changed[index], turned_dps=turned, **rest)
    return replace(SOUND, wheels=changed)


NO_MOTOR = "brick 1.2.3.4: no left motor at port outB; plug it in"
STALLED = wheels(2, (150, 176), is_stalled=(True, False))
UNPLUGGED = replace(SOUND, pictures=[], camera_fault="it was unplugged")
MJPEG, LARGE = {"MJPG": ["640x480"]}, {"YUYV": ["320x240"]}


@pytest.mark.parametrize(
    ("facts", "level", "topic", "text", "advice"),
    [
        (inspected(release="0.0.9"), "note", "versions", "0.0.9", "brick agent 192.168.1.7"),
        (replace(SOUND, round_trips_s=[0.2] * 20), "WRONG", "wi-fi", "200 ms", "closer"),
        (replace(SOUND, round_trips_s=[0.01] * 9 + [0.6]), "note", "wi-fi", "600", "closer"),
        (replace(SOUND, clock_ahead_s=-9e6), "note", "clock", "2500.0 hours behind", "date -s"),
        (replace(SOUND, body_fault=NO_MOTOR), "WRONG", "motors", "outC", NO_MOTOR[15:]),
        (replace(SOUND, wheels=None), "note", "wheels", "not tested", ""),
        (wheels(0, (0, 176)), "WRONG", "wheels", "outB and outC are swapped", "--left-port outC"),
        (wheels(0, (0, 0)), "WRONG", "wheels", "outB) did not turn when it was driven", "gears"),
        (wheels(0, (176, 90)), "WRONG", "wheels", "outC) turned although", "another program"),
        (wheels(2, (-176, 176)), "WRONG", "wheels", "outB) turned backward", "--reversed-motors"),
        (wheels(1, (0, 90)), "WRONG", "wheels", "90 degrees a second instead of 180", "charge"),
        (STALLED, "WRONG", "wheels", "outB) did not turn when it was driven", "is it blocked?"),
        (inspected(sensors=[]), "note", "sensors", "none", "without sensors"),
        (inspected(battery_v=6.2), "WRONG", "battery", "6.2 V", "charge it"),
        (inspected(battery_v=6.8), "note", "battery", "6.8 V", "soon"),
        (inspected(battery_v=None), "note", "battery", "cannot be read", ""),
        (inspected(memory_mb=4.0), "WRONG", "memory", "4 MB", "end other programs"),
        (inspected(memory_mb=None), "note", "memory", "cannot", ""),
        (inspected(card_mb=20.0), "WRONG", "card", "20 MB", "larger card"),
        (inspected(cameras=[]), "WRONG", "camera", "none found", "ev3dev#1546"),
        (camera(fault="busy"), "WRONG", "camera", "busy", "plug"),
        (camera(offers=MJPEG), "note", "camera", "MJPG 640x480", "cannot read MJPEG"),
        (camera(offers=LARGE), "note", "camera", "320x240", "lower frame rate"),
        (UNPLUGGED, "WRONG", "pictures", "it was unplugged", "cable"),
        (replace(SOUND, pictures=pictures(age_s=0.5)), "WRONG", "pictures", "500 ms old", "Wi-Fi"),
        (replace(SOUND, pictures=pictures(period_s=0.2)), "note", "pictures", "5.0 a", "hub"),
    ],
)
def test_each_fault_is_named_with_what_to_do(
    facts: BrickFacts, level: str, topic: str, text: str, advice: str
) -> None:
    assert write_report(examine(SOUND)).endswith("All is well.")
    findings = examine(facts)
    bad = [one for one in findings if one.level is not Level.OK]
    assert len(bad) == 1
    assert (bad[0].level, bad[0].topic) == (level, topic)
    assert text in bad[0].text
    assert advice in bad[0].advice
    assert (f"  {topic}: {bad[0].advice}" in write_report(findings)) == bool(advice)


@pytest.fixture
def doctored(brick: FakeBrick) -> Iterator[VirtualAgent]:
    def inspect(root: str) -> dict[str, Any]:
        return {**inspect_as_ev3(root), "clock_s": brick.clock.wall_s()}

    with VirtualAgent(brick, open_camera=FakeCameraReader, inspect=inspect) as agent:
        yield agent


def found(agent: VirtualAgent, may_turn: bool = True) -> dict[str, Finding]:
    return {one.topic: one for one in examine(measure(agent.link(), lambda: may_turn))}


def test_nothing_moves_without_consent(brick: FakeBrick, doctored: VirtualAgent) -> None:
    assert found(doctored, may_turn=False)["wheels"].text == "not tested"
    assert not [one for one in brick.commands if one.command.startswith("run")]


def test_the_doctor_finds_the_faults_of_a_brick(brick: FakeBrick, doctored: VirtualAgent) -> None:
    assert set(inspect_brick(str(brick.root))) == set(INSPECTED)
    brick.motors["outC"].is_stalled = True
    brick.set_battery(6.1)
    findings = found(doctored)
    assert "right wheel (outC) did not turn when it was driven" in findings["wheels"].text
    assert findings["battery"].text == "6.1 V"
    brick.unplug_motor("outB")
    findings = found(doctored)
    assert "no left motor at port outB" in findings["motors"].advice
    assert findings["motors"].text == "lego-ev3-l-motor at ev3-ports:outC"


@pytest.mark.parametrize(
    ("answer", "may"), [("", True), ("y", True), ("n", False), ("what?", False), (None, False)]
)
def test_consent_is_asked_for(
    answer: str | None, may: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("" if answer is None else answer + "\n"))
    assert command.ask_consent() is may


def masked(text: str) -> str:
    """Mask the figures, because they differ from run to run."""
    return re.sub(r"\b[0-9a-f]{8}\b|[0-9]+(\.[0-9]+)*", "#", text)


def test_a_sound_brick_is_reported_as_in_the_guide_and_a_busy_one_is_reported_in_one_line(
    brick: FakeBrick,
    doctored: VirtualAgent,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    command.furnish(brick)
    monkeypatch.setattr(command, "BrickLink", lambda *_: doctored.link())
    assert main(["brick", "doctor", ADDRESS, "--yes"]) == 0
    printed = capsys.readouterr().out
    assert "All is well." in printed and not brick.is_moving()
    shown = "".join(f"    {line}".rstrip() + "\n" for line in printed.splitlines())
    shown = shown.replace("brick at brick,", "brick at 127.0.0.1,")
    assert masked(shown) in masked(GUIDE.read_text()), f"{GUIDE} must contain this text:\n{shown}"
    with Ev3RemoteDriver(Ev3RemoteOptions(), doctored.link()):
        assert main(["brick", "doctor", ADDRESS]) == 1
    error = capsys.readouterr().err
    assert "busy: 127.0.0.1 controls the robot; stop the other server first" in error
    assert error.count("\n") == 1
    assert main(["brick", "doctor"]) == 2
    said = "name the brick: drivelesson brick doctor ADDRESS, or use --fake"
    assert said in capsys.readouterr().err


@pytest.mark.realtime
def test_the_command_examines_a_simulated_brick(capsys: pytest.CaptureFixture[str]) -> None:
    for _ in range(10):  # the doctor may report a pause of this computer
        assert main(["brick", "doctor", "--fake"]) in (0, 1), "the computer may be too slow"
        said, error = capsys.readouterr()
        if "does not answer" not in error:
            break
    for topic in ("versions", "motors", "wheels", "sensors", "battery", "camera", "pictures"):
        assert topic in said
