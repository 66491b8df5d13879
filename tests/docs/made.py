"""Builds all generated parts of the documents; one test compares them with the files."""

from __future__ import annotations

from pathlib import Path

from tests.faults import page as faults

from . import command_line, decisions, imports, results, values


def made() -> dict[Path, str]:
    """Return the right content of each generated file.

    The table of faults keeps its figures: `python -m tests.faults.page` measures them.
    """
    whole = {
        command_line.PAGE: command_line.render(),
        decisions.INDEX: decisions.render(),
        imports.PAGE: imports.render(),
        results.PAGE: results.render(),
        faults.PAGE: faults.render(faults.PAGE.read_text("utf-8")),
    }
    pages = {page: whole.get(page, page.read_text("utf-8")) for page in values.pages()}
    return {**whole, **{page: values.fill(text) for page, text in pages.items()}}
