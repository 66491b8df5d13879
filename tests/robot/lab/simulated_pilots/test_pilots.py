"""When a simulated pilot takes and returns the wheel, and how its hand delays decisions."""

from dataclasses import replace

import pytest

from robot.lab.simulated_pilots.hand import STEADY, HumanDelayConfig, HumanDelayModel
from robot.lab.simulated_pilots.pilot import SimulatedPilot, TakeoverPolicy
from robot.lab.simulated_pilots.situation import Situation
from robot.types import Action, Mode, Point
from tests.kit.sizes import crossed

from .test_teachers import situation

F, L = Action.FORWARD, Action.LEFT


def held_over_time(
    config: HumanDelayConfig, wishes: list[Action | None], seed: str = "0"
) -> list[str]:
    """Decide every 0.1 s, and list the held move at each of these moments: `f`, `l` or `.`."""
    hand = HumanDelayModel(config, (F, L), seed)
    heard = []
    for tick, wish in enumerate(wishes):
        hand.wish(wish, tick / 10)
        command = hand.send(tick, 0.0, tick / 10)
        heard.append(command.held.value[0] if command.held else ".")
    return heard


ABSENT = {"lapses_per_min": 600.0, "lapse_s": 100.0}
HANDS = {
    "a steady hand acts at once": ({}, [F, F, L, None], "ffl."),
    "reacting takes time": ({"reaction_s": 0.2}, [F, F, L, L, L, L], "..ffll"),
    "looking away, it goes on holding what it held": (ABSENT, [F, F, L, L, L], "fffff"),
    "without a move none slips": ({"tremors_per_min": 600.0}, [None] * 50, "." * 50),
}


@pytest.mark.parametrize(("habits", "wishes", "held"), HANDS.values(), ids=HANDS)
def test_a_hand_follows_the_wanted_move(habits, wishes, held):
    assert "".join(held_over_time(replace(STEADY, **habits), wishes)) == held


def test_a_stick_is_held_as_wanted_and_a_slip_hits_a_button():
    for config, steering in ((STEADY, -0.4), (replace(STEADY, tremors_per_min=1e6), None)):
        hand = HumanDelayModel(config, (F,), "0")
        hand.wish(L, 1.0, Point(-0.4, 0.5))
        commands = [hand.send(17, 0.25, 1.0), hand.send(18, 0.25, 1.1)]
        sent = [(c.frame_id, c.seq, c.received_s, c.frame_age_s) for c in commands]
        assert sent == [(17, 1, 1.0, 0.25), (18, 2, 1.1, 0.25)]
        assert commands[1].held is (L if steering else F)
        assert commands[1].point == (Point(steering, 0.5) if steering else None)
        hand.release()
        command = hand.send(3, 0.0, 1.1)
        assert command.held is None and command.point is None


def test_tremor_slips_as_often_as_it_should_and_repeats_with_its_seed():
    shaky = replace(STEADY, tremors_per_min=30.0, tremor_s=0.1)
    heard = held_over_time(shaky, [F] * 6000)
    # Thirty slips a minute for ten minutes; half of the slips hit the button that is already held.
    assert heard.count("l") == pytest.approx(150, abs=45)
    assert heard == held_over_time(shaky, [F] * 6000)
    assert heard != held_over_time(shaky, [F] * 6000, seed="1")


class Strict:
    """A teacher that always wants LEFT, tolerates nothing else, and records the age of each
    view."""

    def __init__(self) -> None:
        self.seen_s: list[float] = []

    def choose(self, situation: Situation) -> Action:
        self.seen_s.append(situation.at_s)
        return L

    def tolerates(self, situation: Situation, action: Action) -> bool:
        return action is L


STRICT = TakeoverPolicy(patience_s=0.3, shortest_hold_s=0.5, contented_s=0.2, lenience=0.0)
LENIENT = replace(STRICT, lenience=1.0, lenient_patience_s=0.6)
PILOTS = {
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
    ("mode", "takeover", "doing", "proposed", "held"), PILOTS.values(), ids=PILOTS
)
def test_the_pilot_takes_the_wheel_and_returns_it(mode, takeover, doing, proposed, held):
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


def looks(hand: HumanDelayConfig, rate_hz: int) -> list[float]:
    """Show the pilot a camera's pictures for 20 s; return the times of those that he looked at."""
    teacher = Strict()
    who = SimulatedPilot(teacher, (F, L), hand=hand)
    who.change_mode(Mode.TRAIN)
    for tick in range(20 * rate_hz):
        who.act(replace(situation(at_s=tick / rate_hz), frame_id=tick), L)
    return teacher.seen_s


@crossed(rate_hz=[5, 10, 15, 30], looks_hz=[5.0, 7.0, 8.0, 10.0])
def test_the_pilot_looks_equally_often_at_any_frame_rate(rate_hz, looks_hz):
    seen_s = looks(HumanDelayConfig(looks_hz=looks_hz), rate_hz)
    assert len(seen_s) == pytest.approx(20 * looks_hz, abs=2)
    ages_s = [i / looks_hz - at_s for i, at_s in enumerate(seen_s)]
    assert all(-1e-3 <= age_s < 1 / rate_hz + 1e-3 for age_s in ages_s), "always the newest"
