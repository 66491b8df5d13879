"""`drivelesson class` as delivered: a wheel in a new environment, run in a new folder.

Ten pupils (two in `make test`) teach and hand over at the same time, and one STOP stops all. The
time from the press on the board's open page is printed; a busy machine may take longer.
"""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import sysconfig
import threading
import venv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
from websockets.sync.client import connect

from robot.clock import RealClock
from server.board.class_key import read_class_key
from tests.kit.sizes import size
from tests.kit.wait import wait_until
from tests.server.live_robot import Pilot

from .test_class_command import a_class, free_ports, robots_of, running

pytestmark = [pytest.mark.slow]
ROOT = Path(__file__).parents[2]
ROBOTS = size("ROBOTS", 2, 10)


@pytest.fixture(scope="module")
def delivered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the command of the wheel in a separate environment.

    The wheel's requirements are those of these tests; only the program itself is new.
    """
    place = tmp_path_factory.mktemp("delivered")
    building = ["-m", "hatchling", "build", "--target", "wheel", "--directory", str(place)]
    subprocess.run([sys.executable, *building], cwd=ROOT, check=True, capture_output=True)
    (wheel,) = place.glob("*.whl")
    venv.create(place / "venv")
    python = place / "venv/bin/python"
    installing = ["--python", str(python), "install", "--quiet", "--no-deps", str(wheel)]
    subprocess.run([sys.executable, "-m", "pip", *installing], check=True)
    library = next((place / "venv/lib").glob("python*/site-packages"))
    (library / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    asked = [python, "-c", "import robot, server; print(robot.__file__, server.__file__)"]
    said = subprocess.run(asked, cwd=place, capture_output=True, text=True, check=True)
    assert said.stdout.count(str(library)) == 2, "the program is that of the wheel"
    return place / "venv/bin/drivelesson"


def at_once(pupils: list[Pilot], act: Callable[[Pilot], Any]) -> None:
    """Have every pupil do something at the same time; a failure of one fails the test."""
    wrong: list[str] = []

    def one(number: int, pupil: Pilot) -> None:
        try:
            act(pupil)
        except Exception as error:
            wrong.append(f"pupil {number}: {error!r}")

    threads = [threading.Thread(target=one, args=each) for each in enumerate(pupils, 1)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []


def teach(pupil: Pilot) -> None:
    for move, wanted in (("forward", 10), ("left", 20)):
        pupil.drive_until(lambda wanted=wanted: pupil.state["lessons"] >= wanted, move)
    pupil.hold(None)


def hand_over(pupil: Pilot) -> None:
    pupil.drive_until(lambda: pupil.state["mode"] == "autonomous", None, "autonomous")


def stop_all(board: str, pupils: list[Pilot]) -> tuple[float, float]:
    """Press STOP ALL as the page does; return the times until all robots stood and all pupils knew,
    in s.

    A robot reports, by its clock, which is this computer's, when it said that it stands.
    """
    clock = RealClock()
    stood_s: list[float] = []
    knew_s: list[float] = []

    def read(pupil: Pilot) -> None:
        state = pupil.wait_for_state(emergency=True)
        knew_s.append(clock.now_s() - began_s)
        stood_s.append(state["server_ms"] / 1000 - began_s)

    with connect(board.replace("http", "ws", 1) + "/ws/board", origin=board) as page:
        began_s = clock.now_s()
        page.send(json.dumps({"type": "stop"}))
        at_once(pupils, read)
    return max(stood_s), max(knew_s)


@pytest.mark.timeout(600)
def test_pupils_of_a_class_from_the_wheel(delivered: Path, tmp_path: Path) -> None:
    port = free_ports(ROBOTS + 1)
    with (
        a_class(tmp_path, port, ROBOTS, [str(delivered)]) as (board, _),
        contextlib.ExitStack() as leaving,
    ):
        code = read_class_key(tmp_path / "class.key").code
        pupils = []
        for robot in robots_of(board):
            with httpx.Client(
                base_url=robot["address"], headers={"origin": robot["address"]}
            ) as phone:
                phone.post("/api/pair", json={"token": code}).raise_for_status()
                cookie = "; ".join(f"{name}={value}" for name, value in phone.cookies.items())
            options = {"additional_headers": {"Cookie": cookie}, "origin": robot["address"]}
            url = robot["address"].replace("http", "ws", 1) + "/ws/drive"
            pupils.append(leaving.enter_context(Pilot(url, sees=True, **options)))
        at_once(pupils, teach)
        # The board learns of a robot's stop later than its pupil.
        wait_until(
            lambda: all(one["lessons"] >= 20 for one in robots_of(board)), "20 examples each"
        )
        at_once(pupils, hand_over)
        stood_s, knew_s = stop_all(board, pupils)
        print(f"STOP ALL: {ROBOTS} robots stood after {1000 * stood_s:.0f} ms,", end=" ")
        print(f"their pupils knew after {1000 * knew_s:.0f} ms")
        wait_until(lambda: all(one["emergency"] for one in robots_of(board)), "the board knows")
    assert running(tmp_path) == [], "Ctrl-C leaves no process"
