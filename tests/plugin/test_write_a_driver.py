"""Refusals of the command that begins a driver; test_third_party.py tests its result."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.__main__ import main


@pytest.mark.parametrize("name", ["Wheely", "my-bot", "7", "sim", "replay", "", "a" * 40])
def test_invalid_robot_names_are_refused(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["new-driver", name, "--out", str(tmp_path / "out")]) == 2
    assert name in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_no_existing_folder_or_robot_is_overwritten(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "out").mkdir()
    assert main(["new-driver", "wheely", "--out", str(tmp_path / "out")]) == 2
    assert "--out" in capsys.readouterr().err
