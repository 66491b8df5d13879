"""Decisions are listed, and name the decisions that supersede them."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.docs import decisions


def test_each_decision_has_its_own_number_which_is_that_of_its_file() -> None:
    found = decisions.decisions()
    assert [d.number for d in found] == [int(d.file[:4]) for d in found]
    numbers = [d.number for d in found]
    wanted = [n for n in range(1, numbers[-1] + 1) if n not in decisions.MISSING]
    assert numbers == wanted, "the next page takes the next number"


def test_a_superseded_decision_and_its_successor_name_each_other() -> None:
    found = decisions.decisions()
    told = {(d.number, other) for d in found for other in d.made_void_by}
    claimed = {(other, d.number) for d in found for other in d.makes_void}
    assert told == claimed
    assert all("by [" in d.status for d in found if d.status.startswith("superseded"))


def test_a_page_without_a_status_is_refused(tmp_path: Path) -> None:
    page = tmp_path / "0099-perhaps.md"
    page.write_text("# 99. Perhaps\n\n## Context\n")
    with pytest.raises(ValueError, match=r"0099-perhaps\.md must begin with"):
        decisions.read(page)
    page.write_text(
        "# 99. It is so\n\nDate: 2026-01-02. Status: superseded by [7](0007-x.md). "
        "Supersedes [2](0002-y.md).\n"
    )
    read = decisions.read(page)
    assert (read.status, read.made_void_by, read.makes_void) == (
        "superseded by [7](0007-x.md)",
        {7},
        {2},
    )
