"""Writes docs/adr/README.md, the index of the decisions, from their pages: `make docs`."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).parents[2] / "docs/adr"
INDEX = FOLDER / "README.md"
_HEAD = re.compile(
    r"# (?P<number>\d+)\. (?P<title>.+)\n\n"
    r"Date: (?P<date>\d{4}-\d\d-\d\d)\. Status: (?P<status>accepted|superseded)(?P<rest>[^\n]*)\.\n"
)
_LINK = re.compile(r"\[(\d+)\]\(([\w.-]+\.md)\)")
_TOP = """# Decisions

`make docs` writes this page from the decisions; do not edit it by hand.
[The first page](0001-record-decisions.md) explains
which decisions get a page, and when a page is replaced.

| number | decision | date | status |
|---|---|---|---|
"""
_BOTTOM = """
## Missing numbers

No page was removed. Numbers were reserved in advance for parallel work. Some of this work needed no
decision, so 9, 11, 14, 15, 16, 22 and 23 are unused. Page 10 was merged into 5, and page 20 into 3
and 4, on the day they were reserved. No number is used again; a new page takes the next number.
"""
MISSING = {9, 10, 11, 14, 15, 16, 20, 22, 23}


@dataclass(frozen=True, kw_only=True)
class Decision:
    """A page, by its first lines."""

    file: str
    number: int
    title: str
    date: str
    status: str
    """`accepted`, or `superseded` and by what, as in the page's own second line."""
    made_void_by: frozenset[int]
    """The pages by which it is superseded, or partly changed."""
    makes_void: frozenset[int]
    """The pages that it supersedes, or partly changes."""


def read(file: Path) -> Decision:
    """Return the facts in a page's first lines.

    Raises:
        ValueError: If its first lines have another form.
    """
    head = _HEAD.match(file.read_text("utf-8"))
    if head is None:
        raise ValueError(
            f"{file.name} must begin with '# N. Title', an empty line, and one line: "
            "'Date: YYYY-MM-DD. Status: accepted.', where the status may go on with "
            "', changed by [7](...)' or be 'superseded by [7](...)', and 'Changes [2](...).' or "
            "'Supersedes [2](...).' may follow"
        )
    status, _, others = f"{head['status']}{head['rest']}.".partition(". ")
    return Decision(
        file=file.name,
        number=int(head["number"]),
        title=head["title"],
        date=head["date"],
        status=status.removesuffix("."),
        made_void_by=frozenset(int(number) for number, _ in _LINK.findall(status)),
        makes_void=frozenset(int(number) for number, _ in _LINK.findall(others)),
    )


def decisions() -> list[Decision]:
    """Return all pages, by number."""
    return [read(file) for file in sorted(FOLDER.glob("[0-9]*.md"))]


def render() -> str:
    """Return the whole index."""
    found = decisions()
    rows = [f"| {d.number} | [{d.title}]({d.file}) | {d.date} | {d.status} |\n" for d in found]
    return _TOP + "".join(rows) + _BOTTOM
