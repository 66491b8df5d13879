from __future__ import annotations

from itertools import combinations, product

from .sizes import covering


def test_every_pair_of_values_comes_together_in_far_fewer_cases() -> None:
    axes = [range(5), "ab", range(12), "xyz"]
    cases = covering(axes)
    for i, j in combinations(range(4), 2):
        assert {(case[i], case[j]) for case in cases} == set(product(axes[i], axes[j]))
    assert 60 <= len(cases) < 75, "of 360"
    assert len(covering(axes, 1)) == 12
