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
LENIENT = replace(STRICT, lenience=1.0, lenient_patience_s=0.6)


class Strict:
    """Always wants LEFT, and tolerates nothing else."""

    def choose(self, situation: Situation) -> Action:
        return L

    def tolerates(self, situation: Situation, action: Action) -> bool:
        return action is L


CASES = {
    "teaching it drives": (Mode.TRAIN, STRICT, "fff", "fff", "lll"),
    "a good robot is only watched": (Mode.AUTONOMOUS, STRICT, "lllll", "lllll", "....."),
    "its patience ends": (Mode.AUTONOMOUS, STRICT, "lffffff", "fffffff", "....lll"),
    "a lapse is forgiven": (Mode.AUTONOMOUS, STRICT, "ffflffflff", "ffffffffff", ".........."),
    # The wheel is taken at tick 3, for at least half a second; the robot agrees from tick 8 on.
    "it agrees": (Mode.AUTONOMOUS, STRICT, "fffflllllllll", "fffffffflllll", "...lllllll..."),
    "lenient, it waits": (Mode.AUTONOMOUS, LENIENT, "ffffffff", "ffffffff", "......ll"),
    "stopped, it only watches": (Mode.STOPPED, STRICT, "ffffffff", "ffffffff", "........"),
}


@pytest.mark.parametrize(
    ("mode", "takeover", "doing", "proposed", "held"), CASES.values(), ids=CASES
)
def test_the_pilot_takes_the_wheel_and_returns_it(
    mode: Mode, takeover: TakeoverPolicy, doing: str, proposed: str, held: str
) -> None:
    """Tick by tick: the robot's moves, its proposals, and the moves that the pilot holds."""
    who = SimulatedPilot(Strict(), (F, L), hand=STEADY, takeover=takeover)
    who.change_mode(mode)
    names, found = {"f": F, "l": L}, ""
    for tick, (now, next_) in enumerate(zip(doing, proposed, strict=True)):
        seen = replace(situation(at_s=tick / 10, doing=names[now]), frame_id=tick)
        command = who.act(seen, names[next_])
        assert command.frame_id == tick
        found += command.held.value[0] if command.held else "."
    assert found == held


class Counting(Strict):
    """Counts the calls, and notes the age of each view."""

    def __init__(self) -> None:
        self.seen_s: list[float] = []

    def choose(self, situation: Situation) -> Action:
        self.seen_s.append(situation.at_s)
        return L


def looks(hand: HumanDelayConfig, rate_hz: int) -> list[float]:
    """Show the pilot a camera's pictures for 20 s, and return the times of those he looked at."""
    teacher = Counting()
    who = SimulatedPilot(teacher, (F, L), hand=hand)
    who.change_mode(Mode.TRAIN)
    for tick in range(20 * rate_hz):
        who.act(replace(situation(at_s=tick / rate_hz), frame_id=tick), L)
    return teacher.seen_s


@crossed(rate_hz=[5, 10, 15, 30], looks_hz=[5.0, 7.0, 8.0, 10.0])
def test_the_pilot_looks_equally_often_at_any_frame_rate(rate_hz: int, looks_hz: float) -> None:
    seen_s = looks(HumanDelayConfig(looks_hz=looks_hz), rate_hz)
    assert len(seen_s) == pytest.approx(20 * looks_hz, abs=2)
    ages_s = [i / looks_hz - at_s for i, at_s in enumerate(seen_s)]
    assert all(-1e-3 <= age_s < 1 / rate_hz + 1e-3 for age_s in ages_s), "the picture of then"


def test_a_program_looks_at_each_picture_once() -> None:
    assert looks(STEADY, 30) == [tick / 30 for tick in range(600)]
