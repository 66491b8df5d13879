"""A learner's name, as people write it and as it is stored."""

from __future__ import annotations

import pytest

from robot.errors import ConfigurationError
from robot.policy.registry import full_name, learner_kinds, make_policy, split_name


@pytest.mark.parametrize("kind", learner_kinds())
def test_a_kind_or_a_full_name_makes_a_full_name(kind: str) -> None:
    assert full_name(kind, None, 32) == f"{kind}-32"
    assert full_name(f"{kind}-64", None, 32) == f"{kind}-64"
    assert full_name(f"{kind}-64", 16, 32) == f"{kind}-16", "what is asked for counts"
    assert split_name(full_name(f"{kind}-64", None, 32)) == (kind, 64)


@pytest.mark.parametrize(
    "name", ["", "-", "32", "-32", "default-", "defaul", "default-64-32", "²", "default-1٣"]
)
def test_what_names_no_learner_is_refused_as_it_was_given(name: str) -> None:
    with pytest.raises(ConfigurationError) as refusal:
        make_policy(full_name(name, None, 32))
    assert name in str(refusal.value)
