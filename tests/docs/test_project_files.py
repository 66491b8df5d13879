"""The files at the root name the current version."""

from __future__ import annotations

import re
import tomllib
from itertools import pairwise
from pathlib import Path

import pytest

import robot

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
CHANGES = (ROOT / "CHANGELOG.md").read_text("utf-8")
GROUPS = ["Added", "Changed", "Fixed", "Removed"]


def _versions() -> list[tuple[str, str]]:
    """Return the heading and the text of each version."""
    _, *parts = re.split(r"^## ", CHANGES, flags=re.MULTILINE)
    return [(part.partition("\n")[0], part.partition("\n")[2]) for part in parts]


def test_unreleased_changes_are_on_top_and_releases_have_dates() -> None:
    (first, _), *others = _versions()
    assert first == "Unreleased"
    dates = [re.fullmatch(r"\d+\.\d+\.\d+ \((\d{4}-\d\d-\d\d)\)", head) for head, _ in others]
    assert all(dates)
    found = [date[1] for date in dates if date]
    assert all(newer >= older for newer, older in pairwise(found))


@pytest.mark.parametrize(("version", "text"), _versions())
def test_a_version_lists_its_changes_in_four_groups(version: str, text: str) -> None:
    heads = re.findall(r"^### (.+)$", text, flags=re.MULTILINE)
    assert heads, version
    assert heads == sorted(set(heads), key=GROUPS.index)


def test_the_citation_is_of_this_version() -> None:
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    assert f"version: {robot.__version__}\n" in citation
    dates = dict(head.rstrip(")").split(" (") for head, _ in _versions()[1:])
    assert f"date-released: {dates[robot.__version__]}\n" in citation
