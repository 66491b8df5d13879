"""Wrong calls of the lab's commands are told what would be right."""

from __future__ import annotations

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
