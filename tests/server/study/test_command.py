from __future__ import annotations

import os
import shlex
from pathlib import Path

import pytest

from robot.errors import ConfigurationError
from robot.store.folder import Storage
from robot.study.plan import parse_plan
from server.cli.main import main
from server.study.folder import StudyFolder
from tests.server.study.sessions import PLAN


@pytest.mark.parametrize("name", ["trust", "participant", "ssd", "recordings"])
def test_a_question_with_the_name_of_another_column_is_refused_in_a_new_plan(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    """Before, its answers replaced what that column holds: a score or the participant's code."""
    text = f'{PLAN}[[question]]\nname = "{name}"\ntext = "Well?"\n'
    plan = tmp_path / "plan.toml"
    plan.write_text(text)
    assert main(["study", "check", str(plan)]) == 2
    said = f"plan.toml: two of the phases.csv columns are called '{name}'; give each its own name"
    assert said in capsys.readouterr().err
    with pytest.raises(ConfigurationError, match=f"phases.csv columns are called '{name}'"):
        StudyFolder(Storage(tmp_path)).create("walk", text)
    assert name in {question.name for question in parse_plan(text).questions}, "an old one is read"


def test_a_command_that_is_printed_works_as_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """This also works if the folder's name contains a space."""
    (tmp_path / "my lab").mkdir()
    assert main(["study", "new", str(tmp_path / "my lab/plan.toml")]) == 0
    words = capsys.readouterr().out.splitlines()[-1]
    if os.name != "nt":
        assert main(shlex.split(words)[1:]) == 0
    else:
        assert '\\"my lab"\\' in words
