"""The documents tell the truth: links lead somewhere, and every option and word is written down."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from robot.control.link_governor import LinkLevel
from robot.moves import CLASSIC
from robot.types import Action, Mode, StopReason
from server.protocol import ErrorCode
from tests.docs import command_line

ROOT = Path(__file__).parents[2]
WORDS = [Action.STOP, *CLASSIC, *Mode, *StopReason, *ErrorCode, *LinkLevel]
PAGES = [*sorted(ROOT.glob("*.md")), *sorted(ROOT.glob("docs/**/*.md"))]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_relative_link_leads_somewhere(page: Path) -> None:
    links = re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text("utf-8"))
    lost = [
        link
        for link in links
        if not link.startswith(("http:", "https:", "mailto:")) and not (page.parent / link).exists()
    ]
    assert not lost


def test_the_command_line_is_described_as_it_is() -> None:
    assert command_line.PAGE.read_text("utf-8") == command_line.render(), "run: make docs"


@pytest.mark.parametrize("word", WORDS)
def test_every_word_of_the_wire_is_written_down(word: str) -> None:
    assert f"`{word}`" in (ROOT / "docs/reference/protocol.md").read_text("utf-8")
