"""Writes docs/results/README.md from the JSON files beside it, one for each question.

`make docs` writes the page. A run of experiments can replace a question's figures, with its
command, commit and date, if the file names the run's tables that contain them (`take`):

    drivelesson experiment mind --seeds 4 --json mind.json
    python -m tests.docs.results mind.json drivelesson experiment mind --seeds 4
"""

from __future__ import annotations

import datetime
import json
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from robot.lab.experiment import load_experiment
from robot.study.table import Table, format_cell

FOLDER = Path(__file__).parents[2] / "docs/results"
PAGE = FOLDER / "README.md"
_TOP = """# Results

`make docs` writes this page from the JSON files in this folder. Before you quote a figure, read \
[how it is measured](../reference/experiments.md). Earlier results are in \
[the lab book](../lab/earlier.md). The figures were measured on two cores of an AMD EPYC, and \
those of 21 November on two cores of an Intel Xeon, with Python 3.11.7 and numpy 2.4.6. Seeds are \
counted from 0.
"""


def questions() -> dict[Path, dict[str, Any]]:
    """Return each file of a question, in the order of the page."""
    files = sorted(FOLDER.glob("[0-9]*.json"), key=lambda file: int(file.name.partition("-")[0]))
    return {file: json.loads(file.read_text("utf-8")) for file in files}


def render() -> str:
    """Return the whole page."""
    return "\n".join([_TOP, *(_section(question) for question in questions().values())])


def _section(question: dict[str, Any]) -> str:
    columns = ["", "target", *question["columns"]]
    rows = [[row["what"], row.get("asked", ""), *row["measured"]] for row in question["rows"]]
    lines = [columns, ["---"] * len(columns), *rows]
    runs = [f"`{run['command']}` ({run['commit']}, {run['date']})" for run in question["runs"]]
    unit = question["unit"]
    about = f"{unit[0].upper()}{unit[1:]}. {question['note']}".strip()
    listed = " and ".join([", ".join(runs[:-1]), runs[-1]]) if runs[1:] else runs[0]
    about += f" The figures are from {listed}."
    table = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    return f"## {question['question']}\n\n{about}\n\n{table}\n"


def filled(
    question: dict[str, Any], tables: Sequence[Table], run: dict[str, str]
) -> dict[str, Any]:
    """Return a question with its figures from the tables of a run.

    Raises:
        KeyError: If the run lacks a table, row or column, which the error names.
    """
    cells = {
        (table.title, str(row[0]), column): format_cell(cell)
        for table in tables
        for row in table.rows
        for column, cell in zip(table.columns, row, strict=True)
    }
    rows = []
    for row in question["rows"]:
        new = dict(row)
        if "take" in row:
            new["measured"] = [cells[table, name, column] for table, name, column in row["take"]]
        if "take_asked" in row:
            table, name, column = row["take_asked"]
            new["asked"] = cells[table, name, column]
        rows.append(new)
    return {**question, "rows": rows, "runs": [run]}


def _take(file: Path, command: Sequence[str]) -> None:
    seen = ["git", "-C", str(FOLDER), "rev-parse", "--short", "HEAD"]
    commit = subprocess.run(seen, capture_output=True, text=True, check=True).stdout.strip()
    date = datetime.date.fromtimestamp(file.stat().st_mtime).isoformat()
    run = {"command": shlex.join(command), "commit": commit, "date": date}
    for name, runs in json.loads(file.read_text("utf-8")).items():
        tables = load_experiment(name).tables(
            [(SimpleNamespace(**one), one["result"]) for one in runs]
        )
        wanted = {
            path: question
            for path, question in questions().items()
            if question["experiment"] == name and all("take" in row for row in question["rows"])
        }
        if not wanted:
            raise SystemExit(
                f"no question in {FOLDER} takes its figures from {name!r}: fill `take`"
            )
        for path, question in wanted.items():
            text = json.dumps(filled(question, tables, run), indent=1, ensure_ascii=False)
            path.write_text(text + "\n", "utf-8")


if __name__ == "__main__":
    if sys.argv[1:]:
        _take(Path(sys.argv[1]), sys.argv[2:])
    PAGE.write_text(render(), encoding="utf-8")
