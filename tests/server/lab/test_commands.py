"""Wrong calls of the lab's commands are told what would be right."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.cli.main import main

WRONG = [
    (["bench", "lnk"], "(did you mean 'link'?)"),
    (["experiment", "figure3", "--seeds", "0"], "--seeds: must be a whole number of at least 1"),
]


@pytest.mark.parametrize(("words", "sentence"), WRONG)
def test_a_wrong_call_is_told_what_would_be_right(
    words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as left:
        main(words)
    assert left.value.code == 2
    assert sentence in capsys.readouterr().err


@pytest.mark.parametrize("name", ["habits", "ready", "degrees"])
def test_two_learners_for_one_are_refused_before_anything_runs(
    name: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    two = ["--learner", "default-16", "--learner", "published-16"]
    words = ["experiment", "figure7", name, "--quick", "--folder", str(tmp_path / "runs")]
    assert main([*words, *two]) == 1
    assert "name one --learner, not default-16, published-16" in capsys.readouterr().err
    assert not (tmp_path / "runs").exists()
