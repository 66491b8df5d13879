"""From decision to button: times and errors of a simulated hand."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robot.lab.simulated_pilots.hand import STEADY, HumanDelayConfig, HumanDelayModel
from robot.types import Action, Point

F, L = Action.FORWARD, Action.LEFT


def held_over_time(
    config: HumanDelayConfig, wishes: list[Action | None], seed: str = "0"
) -> list[str]:
    """Decide every 0.1 s, and list the held move at each of these moments: `f`, `l` or `.`."""
    hand = HumanDelayModel(config, (F, L), seed)
    heard = []
    for tick, wish in enumerate(wishes):
        now_s = tick / 10
        hand.wish(wish, now_s)
        command = hand.send(tick, 0.0, now_s)
        heard.append(command.held.value[0] if command.held else ".")
    return heard


ABSENT = {"lapses_per_min": 600.0, "lapse_s": 100.0}
CASES = {
    "a steady hand acts at once": ({}, [F, F, L, None], "ffl."),
    "reacting takes time": ({"reaction_s": 0.2}, [F, F, L, L, L, L], "..ffll"),
    "looking away, it goes on holding what it held": (ABSENT, [F, F, L, L, L], "fffff"),
    "without a move none slips": ({"tremors_per_min": 600.0}, [None] * 50, "." * 50),
}


@pytest.mark.parametrize(("habits", "wishes", "held"), CASES.values(), ids=CASES)
def test_a_hand_follows_the_wanted_move(
    habits: dict[str, float], wishes: list[Action | None], held: str
) -> None:
    assert "".join(held_over_time(replace(STEADY, **habits), wishes)) == held


def test_a_stick_is_held_as_wanted_and_a_slip_hits_a_button() -> None:
    for config, steering in ((STEADY, -0.4), (replace(STEADY, tremors_per_min=1e6), None)):
        hand = HumanDelayModel(config, (F,), "0")
        hand.wish(L, 1.0, Point(-0.4, 0.5))
        hand.send(1, 0.0, 1.0)
        command = hand.send(2, 0.0, 1.1)
        assert command.held is (L if steering else F)
        assert command.point == (Point(steering, 0.5) if steering else None)
        hand.release()  # at once
        command = hand.send(3, 0.0, 1.1)
        assert command.held is None and command.point is None


def test_commands_count_up_and_name_the_frame_on_the_screen() -> None:
    hand = HumanDelayModel(STEADY, (F, L), "0")
    hand.wish(F, 1.0)
    commands = [hand.send(17, 0.25, 1.0), hand.send(18, 0.25, 1.1)]
    assert [(c.frame_id, c.seq, c.received_s, c.frame_age_s) for c in commands] == [
        (17, 1, 1.0, 0.25),
        (18, 2, 1.1, 0.25),
    ]


def test_tremor_slips_as_often_as_it_should_and_repeats_with_its_seed() -> None:
    shaky = replace(STEADY, tremors_per_min=30.0, tremor_s=0.1)
    heard = held_over_time(shaky, [F] * 6000)
    slips = heard.count("l")
    # Thirty slips a minute for ten minutes; half of them hit the button that is already held.
    assert slips == pytest.approx(150, abs=45)
    assert heard == held_over_time(shaky, [F] * 6000)
    assert heard != held_over_time(shaky, [F] * 6000, seed="1")
