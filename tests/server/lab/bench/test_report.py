"""Ratios of alternating measurements, and when no ratio is printed."""

from __future__ import annotations

from server.lab.bench.report import in_turns


def test_the_ratio_is_that_of_a_turn_in_the_middle() -> None:
    found = in_turns([2.0, 30.0, 4.0], [4.0, 50.0, 10.0])

    assert (found["ratio"], found["spread"]) == (0.5, 0.2)
    assert (found["own"], found["peer"], found["turns"]) == (4.0, 10.0, 3)


def test_no_ratio_is_given_if_the_turns_differ_too_much() -> None:
    assert in_turns([1.0, 1.0, 2.1], [1.0, 1.0, 1.0])["ratio"] is None
    assert in_turns([1.0, 1.0, 1.9], [1.0, 1.0, 1.0])["ratio"] == 1.0
