from __future__ import annotations

import os
import shlex
from pathlib import Path

import pytest

from server.cli.main import main


def test_a_command_that_is_printed_works_as_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also where a folder has a space in its name."""
    (tmp_path / "my lab").mkdir()
    assert main(["study", "new", str(tmp_path / "my lab/plan.toml")]) == 0
    words = capsys.readouterr().out.splitlines()[-1]
    if os.name != "nt":
        assert main(shlex.split(words)[1:]) == 0
    else:
        assert '\\"my lab"\\' in words
