"""The newcomers' script still fits the page.

The drives themselves take minutes (python -m tests.e2e.newcomers)."""

import re

import pytest

from . import newcomers
from .world import sentences


@pytest.mark.parametrize("language", newcomers.LANGUAGES)
def test_newcomers_know_what_the_page_asks_for_in_every_language(language: str) -> None:
    words = sentences(language)
    for asked, names in newcomers.TOLD.items():
        keys = [key for key in words if key.startswith(names)]
        assert all(any(key.startswith(name) for key in keys) for name in names)
        for key in keys:
            text = re.sub(r"\{\w+\}", "12", words[key])
            assert newcomers.asked_by(text, words) == asked, key
    assert newcomers.asked_by("", words) is None
