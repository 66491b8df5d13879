"""The documents tell the truth: links lead somewhere, and every option and word is written down."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from robot.control.link_governor import LinkLevel
from robot.driver import CLASSIC
from robot.types import Action, Mode, StopReason
from server.protocol import ErrorCode
from tests.docs import command_line, commands, wiring

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


def test_the_wiring_is_drawn_as_it_is() -> None:
    for file, text in wiring.render().items():
        assert file.read_text("utf-8") == text, "run: make docs"
        assert any(file.name in page.read_text("utf-8") for page in PAGES), "no page shows it"


@pytest.mark.parametrize("word", WORDS)
def test_every_word_of_the_wire_is_written_down(word: str) -> None:
    assert f"`{word}`" in (ROOT / "docs/reference/protocol.md").read_text("utf-8")


def test_every_refusal_of_the_guard_is_written_down() -> None:
    sources = [file.read_text("utf-8") for file in ROOT.glob("server/access/*.py")]
    refused = {pair for text in sources for pair in re.findall(r'\b(4\d\d|5\d\d), "(\w+)"', text)}
    page = (ROOT / "docs/reference/http.md").read_text("utf-8")
    rows = re.findall(r"^\| ([\d, ]+) \| (`[\w`, ]+`) \|", page, re.M)
    written = {(n, e) for ns, es in rows for n in ns.split(", ") for e in re.findall(r"\w+", es)}
    assert len(refused) > 10
    assert refused - written == set()


LIVING = [page for page in PAGES if page.name != "CHANGELOG.md" and "lab" not in page.parts]
"""Pages that name things as they are called now; decisions too."""
CURRENT = [page for page in PAGES if page.name != "CHANGELOG.md" and "adr" not in page.parts]
"""Pages about the program as it is now; decisions and changes tell of earlier ones too."""


@pytest.mark.parametrize("page", CURRENT, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_command_that_a_page_names_exists(page: Path) -> None:
    assert commands.unknown(page.read_text("utf-8")) == []


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("`drivelesson dance`", "drivelesson dance"),
        ("    drivelesson serve --robot sim --fly 3", "drivelesson serve --fly"),
        ("```sh\ndrivelesson evaluate FOLDER \\\n  --port 3\n```", "drivelesson evaluate --port"),
        ("`drivelesson episodes juggle`", "drivelesson episodes juggle"),
        ("`--teleport`", "--teleport"),
        ('`make run ARGS="--teleport"`', "drivelesson serve --teleport"),
        ("`make coffee`", "make coffee"),
        ("`pip install 'drivelesson[wings]'`", "drivelesson[wings]"),
    ],
)
def test_a_command_that_does_not_exist_is_found(text: str, fault: str) -> None:
    assert commands.unknown(f"Do this:\n\n    drivelesson --lan\n\nThen:\n\n{text}\n\nDone.\n") == [
        fault
    ]


def test_commands_that_exist_pass() -> None:
    page = (
        "`drivelesson`, `drivelesson --lan`, `drivelesson bench link --rate 9`, `make run`, `ls -l`"
    )
    assert commands.unknown(page) == []


_PLACE = re.compile(r"(?<![\w./-])((?:robot|server|web|tests|docs)/[\w./*-]*\w|\.ci/run)(?![\w*])")


@pytest.mark.parametrize("page", LIVING, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_file_that_a_page_names_is_there(page: Path) -> None:
    places = _PLACE.findall(" ".join(re.findall(r"`([^`\n]+)`", page.read_text("utf-8"))))
    named = [place for place in places if not re.search(r"/[A-Z]+\b(?!\.)", place)]  # server/HOUSE
    assert [place for place in named if not [*ROOT.glob(place)]] == []
