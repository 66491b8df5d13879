"""The program counts ends just after the motors have started, but not updates or ends at rest."""

from __future__ import annotations

from pathlib import Path

import pytest

from robot.bodies.early_ends import SOON_S, EarlyEnds
from robot.control.state import Tick
from robot.types import Action, Decision, DrivenBy, Mode, StopReason
from tests.robot.bench_robot import BenchRobot


def tick(now_s: float, mode: Mode, sent: Action = Action.STOP) -> Tick:
    driven_by = DrivenBy.PILOT if sent is not Action.STOP else DrivenBy.NOBODY
    return Tick(
        now_s=now_s, sent=sent, decision=Decision(mode=mode, action=sent, driven_by=driven_by)
    )


def run(file: Path, *, drives_s: float | None, ends_well: bool) -> EarlyEnds:
    """Start the program, drive for this time (None means not at all), and end the program."""
    ends = EarlyEnds(file)
    ends.note(tick(0.0, Mode.STOPPED))
    if drives_s is not None:
        ends.note(tick(1.0, Mode.TRAIN))
        ends.write()
        for step in range(round(drives_s * 10) + 1):
            ends.note(tick(2.0 + step / 10, Mode.TRAIN, Action.FORWARD))
        ends.write()
    if ends_well:
        ends.close()
    return ends


def test_two_brownouts_in_a_row_are_reported_until_a_drive_succeeds(tmp_path: Path) -> None:
    file = tmp_path / "drive-began.json"
    assert run(file, drives_s=0.2, ends_well=False).count == 0
    assert run(file, drives_s=None, ends_well=True).count == 1, "an update hides no power cut"
    assert run(file, drives_s=0.2, ends_well=False).count == 1
    third = EarlyEnds(file)
    assert third.is_weak and third.count == 2
    borne: list[None] = []
    fourth = EarlyEnds(file, lambda: borne.append(None))
    for step in range(round(10 * SOON_S) + 2):
        fourth.note(tick(step / 10, Mode.TRAIN, Action.FORWARD))
    fourth.write()
    assert len(borne) == 1 and not EarlyEnds(file).is_weak


@pytest.mark.parametrize(
    ("drives_s", "ends_well"),
    [(None, False), (0.2, True), (SOON_S + 1.0, False), (None, True)],
    ids=["cut at rest", "update as it drives", "cut after a long drive", "update at rest"],
)
def test_other_ends_of_the_program_are_not_blamed_on_the_battery(
    tmp_path: Path, drives_s: float | None, ends_well: bool
) -> None:
    for _ in range(4):
        run(tmp_path / "mark.json", drives_s=drives_s, ends_well=ends_well)
    assert EarlyEnds(tmp_path / "mark.json").count == 0


def test_ticks_are_noted_only_until_the_drive_has_lasted(tmp_path: Path) -> None:
    file, robot = tmp_path / "mark.json", BenchRobot()
    run(file, drives_s=0.2, ends_well=False)
    ends, heard = EarlyEnds(file), []
    note = ends.note
    ends.note = lambda tick: [heard.append(tick.now_s), note(tick)]
    ends.start(robot.loop)
    robot.start(Mode.TRAIN)
    began_s = robot.clock.now_s()
    for scene in range(round(10 * SOON_S) + 20):
        robot.step(scene, Action.FORWARD, 0.1)
    assert ends.count == 0, "a drive that lasted clears the count"
    assert SOON_S <= heard[-1] - began_s < SOON_S + 0.5 and len(heard) > 40
    robot.loop.trip(StopReason.PILOT_ASKED)
    robot.tick()
    ends.close()
    assert not robot.loop._cycle.listeners and EarlyEnds(file).count == 0


@pytest.mark.parametrize("text", ["", "[]", '{"early_ends": -5, "drive_began": 1}', "{", "null"])
def test_an_unreadable_mark_counts_as_none(tmp_path: Path, text: str) -> None:
    (tmp_path / "mark.json").write_text(text)
    assert EarlyEnds(tmp_path / "mark.json").count == 0
