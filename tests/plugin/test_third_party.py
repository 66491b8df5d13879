"""Follows docs/howto/write-a-driver.md literally: makes, installs, serves and teaches a new robot.
tests/robot/recordings and tests/robot/exchange test recordings and exports of a robot's own moves.
"""

from __future__ import annotations

import re
from pathlib import Path

import httpx
import pytest

from server.__main__ import main
from tests.kit.served import served
from tests.plugin.environment import OwnEnvironment, imported
from tests.server.live_robot import Pilot
from tests.standins.mjpeg import MjpegServer

HOWTO = Path(__file__).parents[2] / "docs/howto/write-a-driver.md"
MOVES = ("fast", "slow", "push")


@pytest.mark.parametrize("name", ["Wheely", "my-bot", "7", "sim", "", "a" * 22])
def test_invalid_robot_names_are_refused(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["new-driver", name, "--out", str(tmp_path / "out")]) == 2
    assert name in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_no_existing_folder_or_robot_is_overwritten(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["new-driver", "wheely", "--out", str(tmp_path)]) == 2
    assert "--out" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.timeout(600)  # a busy machine needs long for virtual environments
@pytest.mark.realtime
def test_the_howto_works_as_written_and_its_robot_is_served_and_taught(tmp_path: Path) -> None:
    environment = OwnEnvironment(tmp_path / "venv")
    [block] = re.findall(r"```console\n(.*?)```", HOWTO.read_text("utf-8"), re.DOTALL)
    commands = [line.removeprefix("$ ") for line in block.splitlines() if line]
    assert len(commands) == 3
    *_, printed = [environment.run(command, tmp_path) for command in commands]
    package = tmp_path / "drivelesson-wheely"
    made = {path.name for path in package.iterdir() if path.is_file()}
    assert made == {"pyproject.toml", "drivelesson_wheely.py", "conftest.py"}
    assert len((package / "drivelesson_wheely.py").read_text().splitlines()) <= 75
    assert re.search(r"\b[12][0-9] passed in", printed), printed
    assert "skipped" not in printed and "failed" not in printed
    the_new_robot_is_served_and_taught(environment, package, tmp_path / "served")


def the_new_robot_is_served_and_taught(
    environment: OwnEnvironment, package: Path, folder: Path
) -> None:
    with (
        imported(package, "conftest", "drivelesson_wheely") as (kit, _),
        kit.stand_in() as robot,
        MjpegServer() as camera,
    ):
        options = f"--robot wheely --camera mjpeg --source {camera.address} --wheely-address"
        words = (*options.split(), robot.driver.options.wheely_address)
        with served(folder, *words, python=environment.python) as server:

            def n_taught(move: str) -> int:
                counts = httpx.get(f"{server.address}/api/teaching").json()["taught"]
                return int(counts.get(move, 0))

            with Pilot(server.drive_url) as pilot:
                labels = {one["name"]: one["label"]["en"] for one in pilot.hello["declared_moves"]}
                assert [labels[move] for move in MOVES] == ["Fast", "Slow", "Push"]
                for move in MOVES:
                    pilot.drive_until(lambda m=move: n_taught(m) >= 3, move)
        assert not robot.is_moving()
