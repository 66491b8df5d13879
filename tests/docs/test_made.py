"""The documents agree with the program: generating them again changes nothing."""

from __future__ import annotations

from pathlib import Path

from .made import made


def _as_it_is(path: Path) -> str:
    return path.read_text("utf-8") if path.exists() else ""


def test_make_docs_changes_nothing() -> None:
    files = made()
    assert len(files) > 90
    assert [str(path) for path, text in files.items() if _as_it_is(path) != text] == [], (
        "run: make docs"
    )
