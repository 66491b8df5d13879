"""docs/howto/write-a-driver.md, followed literally: a third-party robot is made and installed,
served, taught, recorded, exported and learned again; and our own suite runs beside it.

All tests are in one file and share one environment.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from tests.kit.sizes import only_full
from tests.plugin.environment import OwnEnvironment, imported
from tests.server.live_robot import Pilot
from tests.standins.mjpeg import MjpegServer

ROOT = Path(__file__).parents[2]
pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(600),  # virtual environments on a busy machine
]
MOVES = ("fast", "slow", "push")
ENOUGH = 12
"""Examples of each move."""
_OVER_SOCKETS = ("ev3", "gpio", "lego", "mjpeg", "pybricks", "ros", "udp", "v4l2", "ws")
"""Our drivers and cameras whose contract takes long, and which a third-party package cannot
affect."""


def test_the_howto_works_as_written(followed: tuple[Path, list[str]]) -> None:
    folder, printed = followed
    package = folder / "drivelesson-wheely"
    made = {path.name for path in package.iterdir() if path.is_file()}
    assert made == {"pyproject.toml", "drivelesson_wheely.py", "conftest.py"}
    assert len((package / "drivelesson_wheely.py").read_text().splitlines()) <= 75
    assert re.search(r"\b[12][0-9] passed in", printed[-1]), printed[-1]
    assert "skipped" not in printed[-1] and "failed" not in printed[-1]


@only_full
def test_with_a_third_party_plugin_our_own_suite_passes(
    environment: OwnEnvironment, followed: tuple[Path, list[str]]
) -> None:
    """Tests that read the registry of robots: the contract, the reference, the options."""
    listed = environment.run("drivelesson serve --help", followed[0])
    assert "wheely" in listed
    cases = (f"[{kind}" for kind in _OVER_SOCKETS)
    own = " and ".join(f"not {name}" for name in (*cases, "slow_body"))
    files = "tests/docs tests/robot/devices tests/contract"
    printed = environment.run(f"pytest -q -p no:cacheprovider {files} -k '{own}'", ROOT)
    assert " passed" in printed and "failed" not in printed


@contextlib.contextmanager
def served(environment: OwnEnvironment, data: Path, *options: str) -> Iterator[str]:
    """Serve with the command that the package installed; yield the address."""
    program = str(environment.folder / "bin/drivelesson")
    process = subprocess.Popen(
        [program, "serve", "--port", "0", "--data", str(data), *options],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    assert process.stdout is not None
    try:
        for line in process.stdout:
            if found := re.search(r"open (http://\S+)", line):
                yield found[1]
                break
        else:
            pytest.fail("it was not served")
    finally:
        process.send_signal(signal.SIGTERM)
        process.stdout.read()
        process.wait(60)
        process.stdout.close()


def taught(address: str) -> dict[str, int]:
    counts: dict[str, int] = httpx.get(f"{address}/api/teaching").json()["taught"]
    return counts


def teach_in_one_drive(environment: OwnEnvironment, package: Path, data: Path) -> dict[str, int]:
    """Serve the robot and teach it; return the number of examples of each move."""
    with (
        imported(package, "conftest", "drivelesson_wheely") as (kit, _),
        kit.stand_in() as robot,
        MjpegServer() as camera,
    ):
        options = [
            "--wheely-address",
            robot.driver.options.wheely_address,
            "--source",
            camera.address,
        ]
        options += ["--robot", "wheely", "--camera", "mjpeg"]
        with served(environment, data, *options) as address:
            with Pilot(address.replace("http", "ws", 1) + "/ws/drive") as pilot:
                labels = {one["name"]: one["label"]["en"] for one in pilot.hello["declared_moves"]}
                assert [labels[move] for move in MOVES] == ["Fast", "Slow", "Push"]
                for move in MOVES:
                    pilot.drive_until(lambda m=move: taught(address).get(m, 0) >= ENOUGH, move)
                pilot.hold(None)
                pilot.mode("stopped")
                pilot.wait_for_state(mode="stopped")
            lessons = taught(address)
        assert not robot.is_moving()
    return lessons


@pytest.mark.realtime
def test_a_third_party_robot_is_taught_recorded_exported_and_learned(
    environment: OwnEnvironment, followed: tuple[Path, list[str]], tmp_path: Path
) -> None:
    package = followed[0] / "drivelesson-wheely"
    for attempt in range(5):  # a computer that is paused meanwhile ends the drive
        data = tmp_path / f"data{attempt}"
        lessons = teach_in_one_drive(environment, package, data)
        if len(list((data / "episodes").iterdir())) == 1:
            break
    assert set(lessons) == set(MOVES) and min(lessons.values()) >= ENOUGH
    kept = f"--data {data}"
    exported = tmp_path / "tub"
    environment.run(f"drivelesson episodes export last --as tub --out {exported} {kept}", tmp_path)
    records = (exported / "catalog_0.catalog").read_text().splitlines()
    labels = {json.loads(record)["drivelesson/label"] for record in records}
    assert labels == set(MOVES) and "user/angle" not in json.loads(records[0])
    folder = tmp_path / "set"
    environment.run(
        f"drivelesson episodes export last --as lerobot --out {folder} {kept}", tmp_path
    )
    features = json.loads((folder / "meta/info.json").read_text())["features"]
    assert sorted(features["action"]["names"]) == sorted(MOVES)
    again = environment.run(f"drivelesson learn last --out again {kept}", tmp_path)
    for move, count in lessons.items():
        assert f"{count} {move}" in again
    assert "the nodes are the same as those learned by driving" in again
    environment.run(f"drivelesson episodes import {exported} --name back {kept}", tmp_path)
    back = environment.run(
        f"drivelesson learn back --max-nodes 32 --learner default {kept}", tmp_path
    )
    assert f"{sum(lessons.values())} examples" in back
