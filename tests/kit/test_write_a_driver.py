"""docs/howto/write-a-driver.md, done as it is written; and then our own suite beside a stranger."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from server.__main__ import main
from tests.kit.environment import OwnEnvironment

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.timeout(600)  # virtual environments on a busy machine


def test_the_howto_works_as_written(followed: tuple[Path, list[str]]) -> None:
    folder, printed = followed
    package = folder / "drivelesson-wheely"
    made = {path.name for path in package.iterdir() if path.is_file()}
    assert made == {"pyproject.toml", "drivelesson_wheely.py", "conftest.py"}
    assert len((package / "drivelesson_wheely.py").read_text().splitlines()) <= 75
    assert re.search(r"\b1[0-9] passed in", printed[-1]), printed[-1]
    assert "skipped" not in printed[-1] and "failed" not in printed[-1]


def test_with_a_strangers_plugin_our_own_suite_passes(
    environment: OwnEnvironment, followed: tuple[Path, list[str]]
) -> None:
    """What asks the registry which robots there are: the contract, the reference, the options."""
    listed = environment.run("drivelesson serve --help", followed[0])
    assert "wheely" in listed
    printed = environment.run(
        "pytest -q -p no:cacheprovider tests/docs tests/robot/rig tests/contract/test_drivers.py "
        "tests/contract/test_cameras.py -k 'not ev3 and not v4l2 and not slow_body'",
        ROOT,
    )
    assert " passed" in printed and "failed" not in printed


@pytest.mark.parametrize("name", ["Wheely", "my-bot", "7", "sim", "replay", "", "a" * 40])
def test_names_that_cannot_be_are_refused(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["new-driver", name, "--out", str(tmp_path / "out")]) == 1
    assert name in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_nothing_is_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "out").mkdir()
    assert main(["new-driver", "wheely", "--out", str(tmp_path / "out")]) == 1
    assert "--out" in capsys.readouterr().err
