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


def test_a_steady_hand_does_at_once_what_is_wished() -> None:
    assert held_over_time(STEADY, [F, F, L, None]) == ["f", "f", "l", "."]


def test_the_hand_follows_after_the_reaction_time() -> None:
    slow = replace(STEADY, reaction_s=0.2)
    assert held_over_time(slow, [F, F, L, L, L, L]) == [".", ".", "f", "f", "l", "l"]


def test_a_stick_is_held_as_it_was_wished_and_a_slip_hits_a_button() -> None:
    for config, steering in ((STEADY, -0.4), (replace(STEADY, tremors_per_min=1e6), None)):
        hand = HumanDelayModel(config, (F,), "0")
        hand.wish(L, 1.0, Point(-0.4, 0.5))
        hand.send(1, 0.0, 1.0)
        command = hand.send(2, 0.0, 1.1)
        assert command.held is (L if steering else F)
        assert command.point == (Point(steering, 0.5) if steering else None)
        hand.release()
        assert hand.send(3, 0.0, 1.1).point is None


def test_commands_count_up_and_name_the_frame_on_the_screen() -> None:
    hand = HumanDelayModel(STEADY, (F, L), "0")
    hand.wish(F, 1.0)
    commands = [hand.send(17, 0.25, 1.0), hand.send(18, 0.25, 1.1)]
    assert [(c.frame_id, c.seq, c.received_s, c.frame_age_s) for c in commands] == [
        (17, 1, 1.0, 0.25),
        (18, 2, 1.1, 0.25),
    ]


def test_a_lapse_goes_on_holding_what_was_held() -> None:
    absent = replace(STEADY, lapses_per_min=600.0, lapse_s=100.0)
    heard = held_over_time(absent, [F, F, L, L, L])
    assert heard[0] == "f"
    assert set(heard[2:]) == {"f"}, "it looked away, and did not see that it should turn"


def test_tremor_slips_as_often_as_it_should_and_repeats_with_its_seed() -> None:
    shaky = replace(STEADY, tremors_per_min=30.0, tremor_s=0.1)
    heard = held_over_time(shaky, [F] * 6000)
    slips = heard.count("l")
    # Thirty slips a minute for ten minutes; half of them hit the button that is already held.
    assert slips == pytest.approx(150, abs=45)
    assert heard == held_over_time(shaky, [F] * 6000)
    assert heard != held_over_time(shaky, [F] * 6000, seed="1")


def test_nothing_held_means_nothing_to_slip_from() -> None:
    shaky = replace(STEADY, tremors_per_min=600.0)
    assert set(held_over_time(shaky, [None] * 50)) == {"."}


def test_letting_go_is_at_once() -> None:
    hand = HumanDelayModel(replace(STEADY, reaction_s=0.2), (F, L), "0")
    hand.wish(F, 0.0)
    hand.release()
    assert hand.send(1, 0.0, 1.0).held is None
