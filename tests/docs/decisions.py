"""Writes docs/adr/README.md, the index of the decisions, from their pages: `make docs`."""

from __future__ import annotations

import re
from pathlib import Path

FOLDER = Path(__file__).parents[2] / "docs/adr"
INDEX = FOLDER / "README.md"
_HEAD = re.compile(r"# (\d+)\. (.+)\n\nDate: ([\d-]+)\. Status: (.+?)\.(?: |\n)")
_TOP = """# Decisions

`make docs` generates this page from the pages of the decisions; do not edit it by hand.
[The first page](0001-record-decisions.md) explains which decisions get a page, and when
a page is replaced.

| number | decision | date | status |
|---|---|---|---|
"""
_BOTTOM = """
## Missing numbers

No page was removed. We reserved numbers in advance for parallel work. Some of this work needed no
decision, so the numbers 9, 11, 14, 15, 16, 22 and 23 were never used. Page 10 was merged into
page 5, and page 20 into pages 3 and 4, on the day on which these numbers were reserved. No number
is used twice; a new page gets the next free number.
"""


def render() -> str:
    """Return the whole index.

    Raises:
        ValueError: If the first lines of a page have another form.
    """
    rows = []
    for file in sorted(FOLDER.glob("[0-9]*.md")):
        head = _HEAD.match(file.read_text("utf-8"))
        if head is None:
            raise ValueError(
                f"{file.name} must begin with '# N. Title', an empty line, and the line "
                "'Date: YYYY-MM-DD. Status: accepted.' or '... Status: superseded by [7](...).'"
            )
        number, title, date, status = head.groups()
        rows.append(f"| {number} | [{title}]({file.name}) | {date} | {status} |\n")
    return _TOP + "".join(rows) + _BOTTOM
