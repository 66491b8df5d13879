from __future__ import annotations

import pytest

from robot.errors import ConfigurationError
from robot.policy import autosize


def cost(max_nodes, frame_s):
    return autosize.Cost(
        max_nodes=max_nodes,
        extract_s=0.0,
        propose_s=0.0,
        propose_p99_s=0.0,
        learn_s=frame_s,
        learn_p99_s=frame_s,
    )


@pytest.mark.parametrize(("rate_hz", "expected"), [(14, 32), (100, 4), (1, 256)])
def test_takes_the_largest_size_that_holds_the_rate_with_a_margin(rate_hz, expected):
    chosen = autosize.choose_max_nodes(rate_hz, cost_of=lambda size: cost(size, size * 1e-3))
    assert chosen.max_nodes == expected
    assert chosen.frame_s <= autosize.MARGIN / rate_hz


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, float("nan")])
def test_what_is_no_rate_is_refused(rate_hz):
    with pytest.raises(ConfigurationError, match="above 0"):
        autosize.choose_max_nodes(rate_hz, cost_of=lambda size: cost(size, 1e-3))


def test_stops_at_the_first_size_that_is_too_slow():
    asked = []

    def cost_of(size):
        asked.append(size)
        return cost(size, size * 1e-3)

    autosize.choose_max_nodes(100, cost_of=cost_of)
    assert asked == [2, 4, 8]


@pytest.mark.parametrize("rate_hz", [0, -3, 1e9])
def test_a_rate_that_cannot_be_held_is_refused(rate_hz):
    with pytest.raises(ConfigurationError, match="rate"):
        autosize.choose_max_nodes(rate_hz, cost_of=lambda size: cost(size, 1e-3))


def test_measures_a_full_learner():
    measured = autosize.measure(8, repeats=20)
    assert measured.max_nodes == 8
    assert 0.0 < measured.learn_s <= measured.learn_p99_s < 5.0
    assert measured.rate_hz > 1.0
