"""The page of results agrees with its JSON files."""

from __future__ import annotations

import json
import subprocess
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from robot.study.table import Table
from tests.docs import results

SCHEMA = json.loads((results.FOLDER / "schema.json").read_text("utf-8"))
QUESTIONS = results.questions()


def test_every_question_has_the_same_form() -> None:
    for file, question in QUESTIONS.items():
        Draft202012Validator(SCHEMA).validate(question)
        widths = {len(row["measured"]) for row in question["rows"]}
        widths |= {len(row["take"]) for row in question["rows"] if "take" in row}
        assert widths == {len(question["columns"])}, file


def _git(*words: str) -> str:
    done = subprocess.run(
        ["git", "-C", results.FOLDER, *words], capture_output=True, text=True, check=False
    )
    return done.stdout.strip()


@pytest.mark.skipif(
    _git("rev-parse", "--is-shallow-repository") != "false", reason="no whole history here"
)
def test_every_figure_names_an_existing_commit_and_a_later_date() -> None:
    for run in {str(run): run for one in QUESTIONS.values() for run in one["runs"]}.values():
        is_there = not _git("rev-list", "-1", run["commit"], "--not", "HEAD")
        made = _git("log", "-1", "--format=%cs", run["commit"])
        assert made and is_there and made <= run["date"], run


def test_a_run_replaces_the_figures_that_it_measured() -> None:
    question: dict[str, Any] = {
        "rows": [
            {
                "what": "box",
                "asked": "old",
                "measured": ["old"],
                "take": [["SSD", "default-8", "median"]],
                "take_asked": ["SSD", "default-8", "asked"],
            },
            {"what": "by hand", "measured": ["kept"]},
        ],
        "runs": [],
    }
    table = Table(
        title="SSD", columns=("who", "median", "asked"), rows=(("default-8", 0.254, "below 1"),)
    )
    run = {"command": "drivelesson experiment figure7", "commit": "1234567", "date": "2026-11-25"}
    new = results.filled(question, [table], run)
    assert [row["measured"] for row in new["rows"]] == [["0.25"], ["kept"]]
    assert new["rows"][0]["asked"] == "below 1" and new["runs"] == [run]
    with pytest.raises(KeyError, match="median"):
        results.filled(question, [], run)
