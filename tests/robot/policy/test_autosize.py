from __future__ import annotations

import pytest

from robot.errors import ConfigurationError
from robot.policy import autosize


def cost(max_nodes, frame_s):
    return autosize.Cost(max_nodes=max_nodes, extract_s=[0.0], propose_s=[0.0], learn_s=[frame_s])


@pytest.mark.parametrize(("rate_hz", "expected"), [(14, 32), (100, 4), (1, 256)])
def test_the_largest_size_that_sustains_the_rate_with_a_margin_is_chosen(rate_hz, expected):
    asked = []

    def cost_of(size):
        asked.append(size)
        return cost(size, size * 1e-3)

    chosen = autosize.choose_max_nodes(rate_hz, cost_of=cost_of)
    assert chosen.max_nodes == expected
    assert max(asked) == 2 * expected, "it stops at the first size that is too slow"
    assert chosen.frame_s <= autosize.MARGIN / rate_hz


@pytest.mark.parametrize(
    ("rate_hz", "said"), [(0, "above 0"), (-3, "above 0"), (float("nan"), "above 0"), (1e9, "rate")]
)
def test_an_invalid_or_unreachable_rate_is_refused(rate_hz, said):
    with pytest.raises(ConfigurationError, match=said):
        autosize.choose_max_nodes(rate_hz, cost_of=lambda size: cost(size, 1e-3))


def test_a_full_learner_is_measured():
    measured = autosize.measure(8, repeats=20)
    assert measured.max_nodes == 8
    assert 0.0 < min(measured.learn_s) <= max(measured.learn_s) < 5.0
    assert len(measured.learn_s) == 20 and measured.frame_s < 1.0
