"""Calibration computes the right values, writes them to the file, and works on an EV3 made of
files."""

from __future__ import annotations

import io
import math
from dataclasses import dataclass
from pathlib import Path

import pytest

from robot.bodies.ev3.driver import Ev3Driver, Ev3Options
from robot.bodies.ev3.fake_brick import FakeBrick
from robot.devices.options import option
from robot.errors import ConfigurationError
from robot.types import Action
from server.__main__ import main
from server.bodies import calibrate
from server.bodies.calibrate import correction, keep


def test_an_impossible_measurement_is_refused() -> None:
    assert correction(70.4, 64.0, "cm") == pytest.approx(1.1)
    with pytest.raises(ConfigurationError, match="--reversed-motors"):
        correction(64.0, -64.0, "cm")
    for far_off in (6400.0, 6.4):
        with pytest.raises(ConfigurationError, match="measure again"):
            correction(far_off, 64.0, "cm")


@pytest.mark.parametrize("reversed_motors", [False, True])
def test_wheels_roll_forwards_however_the_motors_are_mounted(
    brick: FakeBrick, reversed_motors: bool
) -> None:
    options = Ev3Options(brick_root=str(brick.root), reversed_motors=reversed_motors)
    with Ev3Driver(options, brick.clock) as driver:
        rolled_m = driver.roll(Action.FORWARD, 1.0)
        assert rolled_m == pytest.approx((0.16, 0.16), rel=0.05)
        back_m, still_m = driver.roll(Action.LEFT, 1.0)
        assert math.degrees((still_m - back_m) / options.track_m) == pytest.approx(18.5, rel=0.05)


@pytest.mark.parametrize(
    ("spelled", "before"),
    [
        ("track_m", ""),
        ('"track_m"', "# für mich\n\n"),
        ("'track-m'", 'name = "Müller 李"\r\n'),
        ("  track_m  ", "\ufeffport = 1\r\n\r\n"),
    ],
)
def test_a_setting_is_replaced_in_any_spelling_and_the_rest_of_the_file_stays(
    spelled: str, before: str, tmp_path: Path
) -> None:
    file = tmp_path / "drivelesson.toml"
    file.write_bytes(f"{before}{spelled} = 0.1 # old\nlan = true\n\n[gate]\nx = 0.3\n".encode())
    keep(file, {"track_m": 0.12, "wheel_diameter_m": 0.055})
    assert file.read_text("utf-8") == before.replace("\r", "").removeprefix("\ufeff") + (
        "track_m = 0.12\nlan = true\nwheel_diameter_m = 0.055\n\n[gate]\nx = 0.3\n"
    )


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"a = [\n  [1, 2],\n  [3, 4]\n]\ntrack_m = 0.1\n", r"yourself: track_m = 0\.12$"),
        (b'a = """\ntrack_m = 0.1\n"""\n', r"yourself: track_m = 0\.12$"),
        (b'a = """\n[gate]\n"""\n', r"yourself: track_m = 0\.12$"),
        ("name = 'Müller'\n".encode("cp1252"), r"cannot write .*drivelesson.toml: .*utf-8"),
    ],
    ids=["a table that is none", "a line of text", "a head of text", "another encoding"],
)
def test_a_file_that_cannot_be_changed_stays_as_it_is(
    content: bytes, said: str, tmp_path: Path
) -> None:
    file = tmp_path / "drivelesson.toml"
    file.write_bytes(content)
    with pytest.raises(ConfigurationError, match=said):
        keep(file, {"track_m": 0.12})
    assert file.read_bytes() == content


def test_a_brick_is_calibrated_by_driving(
    brick: FakeBrick,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    @dataclass(frozen=True, slots=True, kw_only=True)
    class OptionsOfBoth(Ev3Options):
        brick: str = option("", "as ev3-remote has it")

    class TimedDriver(Ev3Driver):
        options_type = OptionsOfBoth

        def __init__(self, options: Ev3Options) -> None:
            super().__init__(options, brick.clock)

    monkeypatch.setattr(calibrate, "load_driver", lambda name: TimedDriver)
    robot, file = "ev3-remote --brick ev3.local", tmp_path / "drivelesson.toml"
    file.write_text("forward_speed_mps = 0.2\nport = 8001\n")
    words = f"calibrate --robot {robot} --config {file} --brick-root {brick.root}".split()
    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    assert main(words) == 2
    assert "run it in a terminal" in capsys.readouterr().err
    # The old settings give 0.6 s at 20 cm/s; the robot drives a tenth more, and turns a third less.
    monkeypatch.setattr("sys.stdin", io.StringIO("\nabout so\n13,2\n\n7.4\n"))
    assert main([*words, "--straight-s", "0.6", "--turn-s", "0.6"]) == 0
    said = capsys.readouterr().out
    assert "Please type a number above 0." in said
    assert f"drivelesson serve --robot {robot} --config {file}" in said
    kept = dict(line.split(" = ") for line in file.read_text().splitlines())
    assert float(kept["wheel_diameter_m"]) == pytest.approx(0.0509 * 1.1, rel=0.1)
    assert float(kept["track_m"]) == pytest.approx(0.124 * 1.1 * 1.5, rel=0.15)
    assert kept["port"] == "8001"
    assert not brick.is_moving()
    moves = [c for c in brick.commands if c.command.startswith("run")]
    assert {move.command for move in moves} == {"run-timed"}
