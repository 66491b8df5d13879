"""Errors of the system, libraries and plug-ins become errors that say what to do."""

from __future__ import annotations

import importlib.metadata
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import robot
from robot import errors
from robot.devices.plugins import load_driver
from robot.devices.rig import Rig, build_rig
from robot.errors import (
    CameraError,
    ConfigurationError,
    DriveError,
    MissingExtraError,
    PluginError,
    RecordingError,
    RobotError,
    told_as,
)
from robot.exchange.replay_driver import ReplayDriver
from robot.policy.registry import make_policy
from robot.testing import FakeCamera, FakeDriver, VirtualClock

ROOT = Path(__file__).parents[2]


def test_an_error_of_the_system_is_converted_with_its_reason_and_what_to_do(tmp_path: Path) -> None:
    file = tmp_path / "none"
    said = f"cannot read {file}: No such file or directory; choose another"
    with (
        pytest.raises(ConfigurationError, match=f"^{re.escape(said)}$") as raised,
        told_as(ConfigurationError, f"cannot read {file}", do="choose another"),
    ):
        file.read_bytes()
    assert isinstance(raised.value.__cause__, FileNotFoundError)


def test_only_the_named_kinds_of_errors_are_converted_and_long_reasons_are_truncated() -> None:
    for error, said in ((KeyError(), "KeyError"), (ValueError("x" * 10_000), "x{300}")):
        with (
            pytest.raises(RecordingError, match=f"^it is damaged: {said}$"),
            told_as(RecordingError, "it is damaged", KeyError, ValueError),
        ):
            raise error
    with pytest.raises(OSError, match=r"^another$"), told_as(RecordingError, "damaged", KeyError):
        raise OSError("another")


# Plug-ins ----------------------------------------------------------------------------------------

ODD: list[Exception] = [
    KeyError("port"),
    ValueError(),
    TimeoutError("timed out"),
    AttributeError("'NoneType' object has no attribute 'write'"),
    ModuleNotFoundError("No module named 'thymiodirect'"),
    RuntimeError("two\nlines\n" + 2000 * "x"),
]


def raising(error: Exception) -> Any:
    def raises(*_: object, **__: object) -> None:
        raise error

    return raises


def rig_of(driver: FakeDriver) -> Rig:
    clock = VirtualClock()
    return Rig(driver, FakeCamera(clock), make_policy("published-8"), clock)


@pytest.mark.parametrize("error", ODD, ids=lambda error: type(error).__name__)
def test_a_robot_that_cannot_be_connected_is_reported_in_one_sentence(
    error: Exception, caplog: pytest.LogCaptureFixture
) -> None:
    for call in ("connect", "disconnect"):
        driver = FakeDriver()
        setattr(driver, call, raising(error))
        rig = rig_of(driver)
        caplog.clear()
        with pytest.raises(DriveError) as raised:
            (rig.start if call == "connect" else rig.stop)()
        said = str(raised.value)
        assert said.count("the driver of the robot 'fake' failed in " + call) == 1, said
        assert type(error).__name__ in said and "\n" not in said and len(said) < 600
        assert any(record.exc_info for record in caplog.records), "the author needs a traceback"


def test_our_own_errors_pass_as_they_are() -> None:
    driver, said = FakeDriver(), DriveError("the cable is out")
    driver.connect = raising(said)
    with pytest.raises(DriveError) as raised:
        rig_of(driver).start()
    assert raised.value is said


def test_a_plug_in_that_breaks_when_it_is_loaded_or_made_is_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Broken(FakeDriver):
        def __init__(self, options: Any) -> None:
            raise ODD[0]

    class BrokenCamera(FakeCamera):
        name = "lens"
        for_driver = raising(ODD[0])

    class Point:
        name = "wheely"
        load = raising(SyntaxError("invalid syntax"))

    monkeypatch.setattr("robot.devices.plugins.points", lambda group: [Point()])
    with pytest.raises(PluginError, match=r"'wheely' cannot be loaded: SyntaxError: invalid"):
        load_driver("wheely")
    monkeypatch.setattr(Point, "load", lambda self: Broken)
    with pytest.raises(RobotError, match=r"'wheely' failed in __init__: KeyError: 'port'"):
        build_rig("wheely")
    monkeypatch.setattr("robot.devices.rig.load_driver", lambda name: FakeDriver)
    monkeypatch.setattr("robot.devices.rig.load_camera", lambda name: BrokenCamera)
    with pytest.raises(PluginError, match=r"camera 'lens' failed in for_driver: KeyError: 'port'"):
        build_rig("fake", camera="lens")


def test_a_camera_that_cannot_be_closed_leaves_no_body_connected(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = VirtualClock()
    driver, camera = ReplayDriver(clock=clock), FakeCamera(clock)
    rig = Rig(driver, camera, make_policy("published-8"), clock)
    rig.start()
    close = camera.stop

    def fail() -> None:
        close()
        raise RuntimeError("the library cannot close it")

    monkeypatch.setattr(camera, "stop", fail)
    with pytest.raises(CameraError, match="cannot close"):
        rig.stop()
    assert not driver.is_connected


# Installation ------------------------------------------------------------------------------------

WHEEL = "file:///tmp/drivelesson-0.3.0-py3-none-any.whl"
SHARE = "/home/me/.local/share"


def test_in_a_clone_the_advice_installs_from_the_clone() -> None:
    assert robot.__version__ == importlib.metadata.version("drivelesson")
    command = errors.install_command("ev3")
    assert "pip" in command and "--editable" in command and f"{ROOT}[ev3]" in command


@pytest.mark.parametrize(
    ("system", "prefix", "source", "command"),
    [
        ("posix", f"{SHARE}/uv/tools/x", None, "uv tool install --force 'drivelesson[ev3]'"),
        ("posix", "/me/.cache/uv/x1", None, "uvx --from 'drivelesson[ev3]' drivelesson"),
        ("posix", f"{SHARE}/pipx/venvs/x", None, "pipx install --force 'drivelesson[ev3]'"),
        ("posix", "/venv", WHEEL, f"/bin/python -m pip install 'drivelesson[ev3] @ {WHEEL}'"),
        # PowerShell would print a command in quotes, and cmd.exe knows only double quotes.
        ("nt", "/x", None, r'C:\"A B"\python.exe -m pip install drivelesson[ev3]'),
        ("nt", "/x", WHEEL, rf'C:\"A B"\python.exe -m pip install "drivelesson[ev3] @ {WHEEL}"'),
    ],
)
def test_elsewhere_the_advice_is_for_the_tool_that_installed_it_and_for_its_shells(
    monkeypatch: pytest.MonkeyPatch, system: str, prefix: str, source: str | None, command: str
) -> None:
    python = r"C:\A B\python.exe" if system == "nt" else "/bin/python"
    monkeypatch.setattr(errors, "os", SimpleNamespace(name=system))
    monkeypatch.setattr(errors, "_clone", lambda: None)
    monkeypatch.setattr(errors, "_source", lambda: source)
    monkeypatch.setattr(sys, "prefix", prefix)
    monkeypatch.setattr(sys, "executable", python)
    monkeypatch.setattr("importlib.metadata.version", lambda name: "1.0")  # an environment with pip
    assert errors.install_command("ev3") == command
    assert command in str(MissingExtraError("driving", "ev3"))


def test_the_extra_that_an_error_names_brings_the_library() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    text = "".join(
        f.read_text("utf-8") for d in ("robot", "server") for f in (ROOT / d).rglob("*.py")
    )
    told = re.findall(r'need\("([\w.]+)", f?"[^"]*", "([\w-]+)"\)', text)
    assert len(told) > 10
    for library, extra in told:
        brought = " ".join([*project["dependencies"], *project["optional-dependencies"][extra]])
        assert library.split(".")[0].replace("cv2", "opencv") in brought, (library, extra)


def test_beside_robot_framework_importing_and_starting_end_in_a_sentence(tmp_path: Path) -> None:
    """Robot Framework's package is called `robot`, too, and either package may have been installed
    last."""
    for package in ("robot", "server"):
        shutil.copytree(ROOT / package, tmp_path / package)

    def run(*words: str) -> subprocess.CompletedProcess[str]:
        # -S hides site-packages, so only the folder's packages are found.
        command = [sys.executable, "-S", *words]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)

    (tmp_path / "robot/running").mkdir()  # like Robot Framework's package
    said = run("-c", "import robot").stderr
    assert "ImportError: Robot Framework and Drivelesson" in said.splitlines()[-1]
    done = run("-m", "server")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert done.stderr.startswith("drivelesson: Robot Framework and Drivelesson")
    (tmp_path / "robot/__init__.py").write_text("__version__ = '7.0'\n")
    (tmp_path / "robot/errors.py").write_text("")
    done = run("-m", "server")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "belongs to another project" in done.stderr and "pipx" in done.stderr
