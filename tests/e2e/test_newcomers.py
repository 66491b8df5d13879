"""The form of the newcomers' script; their drives take minutes (python -m tests.e2e.newcomers)."""

from __future__ import annotations

import re

import pytest

from . import newcomers
from .newcomers import Story, main
from .test_holds_still import messages


@pytest.mark.parametrize("language", newcomers.LANGUAGES)
def test_newcomers_know_what_the_page_asks_for_in_every_language(language: str) -> None:
    words = messages(language)
    for asked, names in newcomers.TOLD.items():
        keys = [key for key in words if key.startswith(names)]
        assert all(any(key.startswith(name) for key in keys) for name in names)
        for key in keys:
            text = re.sub(r"\{\w+\}", "12", words[key])
            assert newcomers.asked_by(text, words) == asked, key
    assert newcomers.asked_by("", words) is None


@pytest.mark.parametrize("failures", range(4))
def test_one_in_twelve_may_fail(failures: int, capsys: pytest.CaptureFixture[str]) -> None:
    failing = set(list(newcomers.HABITS)[:failures])

    seen = set()

    def run(story: Story, world: str, with_challenge: bool) -> Story:
        late_s = 400.0 if len(failing) % 2 else None
        story.done_s = late_s if story.habit in failing else 110.0
        seen.update((story.screen, story.language))
        return story

    assert main([], run) == (0 if failures <= 1 else 1)
    said = capsys.readouterr().out
    assert f"{12 - failures} of 12" in said and f"{12 - failures} of them within 120 s" in said
    assert len(seen) == len(newcomers.SIZES) + len(newcomers.LANGUAGES)
