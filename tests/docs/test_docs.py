"""The documents are true: links lead somewhere, and everything that the documents name exists."""

from __future__ import annotations

import json
import re
import subprocess
from dataclasses import fields, is_dataclass
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from robot.bodies.gpio.driver import GpioOptions
from robot.bodies.ros.camera import RosCameraOptions
from robot.bodies.ros.driver import RosOptions
from robot.control.state import LinkLevel
from robot.moves import CLASSIC
from robot.types import Action, Mode, StopReason
from server.protocol import ErrorCode
from tests.docs import commands, results, values
from tests.docs.made import made

ROOT = Path(__file__).parents[2]
WORDS = [Action.STOP, *CLASSIC, *Mode, *StopReason, *ErrorCode, *LinkLevel]
PAGES = [*sorted(ROOT.glob("*.md")), *sorted(ROOT.glob("docs/**/*.md"))]
LIVING = [page for page in PAGES if page.name != "CHANGELOG.md" and "lab" not in page.parts]
"""Pages that use only current names; these include the decisions."""
CURRENT = [page for page in PAGES if page.name != "CHANGELOG.md" and "adr" not in page.parts]
"""Pages about the current program; decisions and the changelog also describe earlier versions."""


def test_make_docs_changes_nothing() -> None:
    files = made()
    assert len(files) > 90
    stale = [
        str(path)
        for path, text in files.items()
        if not path.exists() or path.read_text("utf-8") != text
    ]
    assert stale == [], "run: make docs"


def test_every_relative_link_leads_somewhere() -> None:
    links = [
        (page, link)
        for page in PAGES
        for link in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text("utf-8"))
        if not link.startswith(("http:", "https:", "mailto:"))
    ]
    assert len(links) > 100
    assert [(str(page), link) for page, link in links if not (page.parent / link).exists()] == []


def test_every_command_that_a_page_names_exists() -> None:
    # these commands have options of their own
    ours = [page for page in CURRENT if "examples" not in page.parts]
    unknown = {str(page): commands.unknown(page.read_text("utf-8")) for page in ours}
    assert {page: names for page, names in unknown.items() if names} == {}
    assert commands.unknown("`drivelesson serve --fly 3`, `make run`") == [
        "drivelesson serve --fly"
    ]


def test_every_file_that_a_page_names_is_there() -> None:
    place = re.compile(
        r"(?<![\w./-])((?:robot|server|web|tests|docs)/[\w./*-]*\w|\.ci/run)(?![\w*])"
    )
    named = {
        (str(page), file)
        for page in LIVING
        for code in re.findall(r"`([^`\n]+)`", page.read_text("utf-8"))
        for file in place.findall(code)
        if not re.search(r"/[A-Z]+\b(?!\.)", file)  # server/EXTENSION
    }
    assert len(named) > 50
    assert [(page, file) for page, file in named if not [*ROOT.glob(file)]] == []


def test_every_line_of_a_quotation_begins_with_its_mark() -> None:
    """The page of a lesson shows the quotations only to the teacher."""
    quoted = {page: re.findall(r"^>.*\n(.+)", page.read_text("utf-8"), re.M) for page in PAGES}
    assert any(quoted.values())
    assert [(page.name, line) for page, ls in quoted.items() for line in ls if line[0] != ">"] == []


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


def test_every_default_of_the_tables_is_the_programs() -> None:
    told = values.names((ROOT / "docs/reference/configuration.md").read_text("utf-8"))
    settings = {
        f"{table}.{field.name}"
        for table, source in values.SOURCES.items()
        if is_dataclass(source)
        for field in fields(source)
    }
    assert settings <= {*told} and "learner.nodes" in told


def test_every_marker_of_a_number_is_closed_and_never_begins_a_line() -> None:
    """A marker at the beginning of a line would begin a block of HTML and end the paragraph."""
    for page in PAGES:
        text = page.read_text("utf-8")
        assert not re.search("^<!--=", text, re.M), page
        assert text.count("<!--=") == len(values.names(text)), f"malformed marker: {page}"


IMAGES = ROOT / "docs/images"


def test_every_picture_is_shown_and_every_shown_picture_exists() -> None:
    shown = {
        (page.parent / name).resolve()
        for page in PAGES
        for name in re.findall(
            r"""(?:src="|\]\()([^")\s]*images/[^")\s]+)""", page.read_text("utf-8")
        )
    }
    assert shown == set(IMAGES.iterdir())
    assert sum(path.stat().st_size for path in shown) < 5_000_000, "the pictures are too large"


def test_the_drawn_terminals_are_those_of_the_code() -> None:
    def drawn(name: str, wanted: str) -> list[str]:
        texts = re.findall(r">([^<>]+)</text>", (IMAGES / f"wiring-{name}.svg").read_text("utf-8"))
        return [found[1] for text in texts if (found := re.fullmatch(wanted, text))]

    hub = (ROOT / "docs/examples/firmware/hub.py").read_text("utf-8")
    left, right, eyes, bumper = re.findall(r"\bPort\.([A-F])\b", hub)
    assert drawn("pybricks", "port (.)") == [left, eyes, right, bumper]
    pins = GpioOptions().settings()["motor_pins"]
    assert drawn("gpio", r"GPIO (\d+) .*") == [str(pin) for side in pins for pin in side]
    firmware = (ROOT / "docs/examples/firmware/robot.py").read_text("utf-8")
    [numbers] = re.findall(r"^PINS = \((.*?)\)", firmware, re.MULTILINE)
    assert drawn("esp32", r"pin (\d+)") == numbers.split(", ")
    topics = [RosOptions().cmd_vel_topic, RosCameraOptions().image_topic, "/drivelesson/advice"]
    assert drawn("ros", "(/.+)") == topics


QUESTIONS = results.questions()


def test_every_result_has_the_same_form() -> None:
    schema = json.loads((results.FOLDER / "schema.json").read_text("utf-8"))
    for file, question in QUESTIONS.items():
        Draft202012Validator(schema).validate(question)
        widths = {len(row["measured"]) for row in question["rows"]}
        widths |= {len(row["take"]) for row in question["rows"] if "take" in row}
        assert widths == {len(question["columns"])}, file


def _git(*words: str) -> str:
    done = subprocess.run(["git", "-C", ROOT, *words], capture_output=True, text=True, check=False)
    return done.stdout.strip()


@pytest.mark.skipif(
    _git("rev-parse", "--is-shallow-repository") != "false", reason="the clone is shallow"
)
def test_every_figure_names_an_existing_commit_and_a_later_date() -> None:
    for run in {str(run): run for one in QUESTIONS.values() for run in one["runs"]}.values():
        is_there = not _git("rev-list", "-1", run["commit"], "--not", "HEAD")
        made = _git("log", "-1", "--format=%cs", run["commit"])
        assert made and is_there and made <= run["date"], run
