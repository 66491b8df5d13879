"""The documents are true: links lead somewhere, and every option and word is documented."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from robot.control.state import LinkLevel
from robot.moves import CLASSIC
from robot.types import Action, Mode, StopReason
from server.protocol import ErrorCode
from tests.docs import commands

ROOT = Path(__file__).parents[2]
WORDS = [Action.STOP, *CLASSIC, *Mode, *StopReason, *ErrorCode, *LinkLevel]
PAGES = [*sorted(ROOT.glob("*.md")), *sorted(ROOT.glob("docs/**/*.md"))]


def test_every_relative_link_leads_somewhere() -> None:
    links = [
        (page, link)
        for page in PAGES
        for link in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text("utf-8"))
        if not link.startswith(("http:", "https:", "mailto:"))
    ]
    assert len(links) > 100
    assert [(str(page), link) for page, link in links if not (page.parent / link).exists()] == []


def test_every_line_of_a_quotation_begins_with_its_mark() -> None:
    """The page of a lesson shows the quotations only to the teacher."""
    quoted = {page: re.findall(r"^>.*\n(.+)", page.read_text("utf-8"), re.M) for page in PAGES}
    assert any(quoted.values())
    assert {
        page.name: line for page, lines in quoted.items() for line in lines if line[0] != ">"
    } == {}


def test_every_word_of_the_protocol_is_documented() -> None:
    page = (ROOT / "docs/reference/protocol.md").read_text("utf-8")
    assert [word for word in WORDS if f"`{word}`" not in page] == []


def test_every_refusal_of_the_guard_is_documented() -> None:
    files = [*ROOT.glob("server/access/*.py"), *ROOT.glob("server/gateway/*.py")]
    sources = [file.read_text("utf-8") for file in files]
    refused = {pair for text in sources for pair in re.findall(r'\b(4\d\d|5\d\d), "(\w+)"', text)}
    page = (ROOT / "docs/reference/http.md").read_text("utf-8")
    rows = re.findall(r"^\| ([\d, ]+) \| (`[\w`, ]+`) \|", page, re.M)
    written = {(n, e) for ns, es in rows for n in ns.split(", ") for e in re.findall(r"\w+", es)}
    assert len(refused) > 10
    assert refused - written == set()


LIVING = [page for page in PAGES if page.name != "CHANGELOG.md" and "lab" not in page.parts]
"""Pages that use only current names, decisions included."""
CURRENT = [page for page in PAGES if page.name != "CHANGELOG.md" and "adr" not in page.parts]
"""Pages about the current program; decisions and changes also describe earlier ones."""


def test_every_command_that_a_page_names_exists() -> None:
    ours = [
        page for page in CURRENT if "examples" not in page.parts
    ]  # they have options of their own
    unknown = {str(page): commands.unknown(page.read_text("utf-8")) for page in ours}
    assert {page: names for page, names in unknown.items() if names} == {}


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


def test_every_file_that_a_page_names_is_there() -> None:
    named = {
        (str(page), place)
        for page in LIVING
        for code in re.findall(r"`([^`\n]+)`", page.read_text("utf-8"))
        for place in _PLACE.findall(code)
        if not re.search(r"/[A-Z]+\b(?!\.)", place)  # server/HOUSE
    }
    assert len(named) > 50
    assert [(page, place) for page, place in named if not [*ROOT.glob(place)]] == []
