"""Slopes: growth is found, and chance is not reported as growth."""

from __future__ import annotations

import numpy as np

from tests.soak.measured import slope


def test_a_growth_is_found_and_chance_is_not() -> None:
    times_s = np.arange(0, 3600, 5.0)
    chance = np.random.default_rng(1).normal(size=len(times_s))
    wandering = np.convolve(chance, np.ones(40) / 40, mode="same")
    assert slope(times_s, 150 + chance).is_flat
    assert slope(times_s, 150 + wandering).is_flat, "neighbours that are alike prove less"
    grows = slope(times_s, 150 + 3 * times_s / 3600 + chance)
    assert not grows.is_flat and abs(grows.hourly - 3) < grows.margin
