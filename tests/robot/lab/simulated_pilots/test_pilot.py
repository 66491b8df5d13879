"""When a simulated pilot takes the wheel, and when it returns it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robot.lab.simulated_pilots.hand import STEADY, HumanDelayConfig
from robot.lab.simulated_pilots.pilot import SimulatedPilot, TakeoverPolicy
from robot.lab.simulated_pilots.situation import Situation
from robot.types import Action, Mode
from tests.kit.sizes import crossed
from tests.robot.lab.simulated_pilots.test_teachers import situation

F, L = Action.FORWARD, Action.LEFT
STRICT = TakeoverPolicy(patience_s=0.3, shortest_hold_s=0.5, contented_s=0.2, lenience=0.0)


class Strict:
    """Always wants LEFT, and tolerates nothing else."""

    def choose(self, situation: Situation) -> Action:
        return L

    def tolerates(self, situation: Situation, action: Action) -> bool:
        return action is L


def pilot(takeover: TakeoverPolicy = STRICT, hand: HumanDelayConfig = STEADY) -> SimulatedPilot:
    return SimulatedPilot(Strict(), (F, L), hand=hand, takeover=takeover)


def drive(who: SimulatedPilot, doing: str, proposed: str, start: int = 0) -> str:
    """Let the robot make and propose moves, tick by tick (`f` or `l`); return the held moves (`l`
    or `.`)."""
    names = {"f": F, "l": L}
    held = ""
    for tick, (now, next_) in enumerate(zip(doing, proposed, strict=True), start):
        seen = replace(situation(at_s=tick / 10, doing=names[now]), frame_id=tick)
        command = who.act(seen, names[next_])
        assert command.frame_id == tick
        held += command.held.value[0] if command.held else "."
    return held


def test_while_teaching_it_drives() -> None:
    teacher = pilot()
    teacher.change_mode(Mode.TRAIN)
    assert drive(teacher, "fff", "fff") == "lll"


def test_while_the_robot_does_well_it_only_beats() -> None:
    teacher = pilot()
    teacher.change_mode(Mode.AUTONOMOUS)
    assert drive(teacher, "llllllll", "llllllll") == "........"


def test_it_takes_the_wheel_when_its_patience_ends() -> None:
    teacher = pilot()
    teacher.change_mode(Mode.AUTONOMOUS)
    assert drive(teacher, "lffffff", "fffffff") == "....lll"


def test_a_lapse_of_the_robot_that_passes_is_forgiven() -> None:
    teacher = pilot()
    teacher.change_mode(Mode.AUTONOMOUS)
    assert drive(teacher, "ffflffflfff", "fffffffffff") == "..........."


def test_it_gives_the_wheel_back_when_the_robot_would_do_the_same() -> None:
    teacher = pilot()
    teacher.change_mode(Mode.AUTONOMOUS)
    # The wheel is taken at tick 3, for at least half a second; the robot agrees from tick 8 on.
    assert drive(teacher, "fffflllllllll", "fffffffflllll") == "...lllllll..."


def test_a_lenient_pilot_waits_longer() -> None:
    teacher = pilot(replace(STRICT, lenience=1.0, lenient_patience_s=0.6))
    teacher.change_mode(Mode.AUTONOMOUS)
    assert drive(teacher, "ffffffff", "ffffffff") == "......ll"


def test_watching_it_never_takes_the_wheel() -> None:
    teacher = pilot()
    teacher.change_mode(Mode.STOPPED)
    assert drive(teacher, "ffffffff", "ffffffff") == "........"


class Counting(Strict):
    """Counts the calls, and notes the age of each view."""

    def __init__(self) -> None:
        self.seen_s: list[float] = []

    def choose(self, situation: Situation) -> Action:
        self.seen_s.append(situation.at_s)
        return L


@crossed(rate_hz=[5, 10, 15, 30], looks_hz=[5.0, 7.0, 8.0, 10.0])
def test_it_looks_as_often_whatever_the_camera_s_rate(rate_hz: int, looks_hz: float) -> None:
    teacher = Counting()
    who = SimulatedPilot(teacher, (F, L), hand=HumanDelayConfig(looks_hz=looks_hz))
    who.change_mode(Mode.TRAIN)
    for tick in range(20 * rate_hz):
        who.act(replace(situation(at_s=tick / rate_hz), frame_id=tick), L)
    assert len(teacher.seen_s) == pytest.approx(20 * looks_hz, abs=2)
    ages_s = [i / looks_hz - at_s for i, at_s in enumerate(teacher.seen_s)]
    assert all(-1e-3 <= age_s < 1 / rate_hz + 1e-3 for age_s in ages_s), "the picture of then"


def test_a_program_looks_at_each_picture_once() -> None:
    teacher = Counting()
    who = SimulatedPilot(teacher, (F, L), hand=STEADY)
    who.change_mode(Mode.TRAIN)
    for tick in range(90):
        who.act(replace(situation(at_s=tick / 30), frame_id=tick), L)
    assert teacher.seen_s == [tick / 30 for tick in range(90)]
