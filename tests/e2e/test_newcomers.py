"""The form of the newcomers' script; their drives take minutes (python -m tests.e2e.newcomers)."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from . import newcomers
from .newcomers import Story, main

ENGLISH = (Path(newcomers.__file__).parents[2] / "web/js/messages/en.js").read_text("utf-8")


def test_the_sentences_that_newcomers_obey_are_the_pages_own() -> None:
    source = Path(newcomers.__file__).read_text("utf-8")
    heeded = re.findall(r"startswith\(\(?([^)]*)\)", source)
    sentences = [sentence for group in heeded for sentence in re.findall(r'"([^"]+)"', group)]
    assert len(sentences) >= 7
    for sentence in [*sentences, "Got it"]:
        assert f"'{sentence}" in ENGLISH, sentence


@pytest.mark.parametrize("failures", range(4))
def test_one_in_twelve_may_fail(failures: int, capsys: pytest.CaptureFixture[str]) -> None:
    failing = set(list(newcomers.HABITS)[:failures])

    def run(habit: str, world: str) -> Story:
        late_s = 400.0 if len(failing) % 2 else None
        return Story(habit, done_s=late_s if habit in failing else 170.0)

    assert main([], run) == (0 if failures <= 1 else 1)
    assert f"{12 - failures} of 12" in capsys.readouterr().out
