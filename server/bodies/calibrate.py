"""Measure how far the robot drives and turns, and save its wheel diameter and track width."""

from __future__ import annotations

import argparse
import contextlib
import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tomllib import TOMLDecodeError

from robot.bodies.ev3.driver import ChassisDriver
from robot.devices.options import make_options, options_of
from robot.devices.plugins import load_driver
from robot.errors import ConfigurationError, quoted, told_as
from robot.store.folder import write_whole
from robot.types import Action
from server.cli.parser import declare, number
from server.cli.settings import PREFIX, apply_to, parse_settings, read_settings

ROBOTS = ("ev3", "ev3-remote")
LARGEST_CORRECTION = 3.0
"""Largest plausible correction factor; a larger factor means a typing error or a wrong motor port.
"""
_TABLE = re.compile(r"^\s*\[", re.MULTILINE)


def configure(parser: argparse.ArgumentParser) -> None:
    add, shown = parser.add_argument, " (default: %(default)s)"
    add("--robot", default="ev3", choices=ROBOTS, help="the robot (default: ev3)")
    add(
        "--config",
        type=Path,
        default=Path(os.environ.get(PREFIX + "CONFIG", "drivelesson.toml")),
        help=f"TOML file from which settings are read, and to which results are written{shown}",
    )
    add("--straight-s", type=number(above=0), default=4.0, help=f"seconds of driving{shown}")
    add("--turn-s", type=number(above=0), default=9.75, help=f"seconds of turning{shown}")


def extend(parser: argparse.ArgumentParser, words: Sequence[str]) -> None:
    """Add the chosen robot's options to the parser. Their defaults are the settings in the file
    `--config`."""
    args, _ = parser.parse_known_args(list(words))
    settings = read_settings(args.config if args.config.exists() else None, os.environ)
    options = options_of(load_driver(args.robot).options_type)
    for option in options:
        declare(parser, option)
    known = {o.name: settings.flags[o.name] for o in options if o.name in settings.flags}
    apply_to(parser, replace(settings, flags=known, environ={}))


def run(args: argparse.Namespace) -> int:
    """Drive, ask how far the robot went and turned, and write the results."""
    driver_type = load_driver(args.robot)
    driver = driver_type(make_options(driver_type.options_type, vars(args)))
    assert isinstance(driver, ChassisDriver)
    options = driver.options
    with driver:
        wider = _measure_straight(driver, args.straight_s)
        narrower = _measure_turn(driver, args.turn_s, wider)
    measures = {
        "wheel_diameter_m": round(options.wheel_diameter_m * wider, 5),
        "track_m": round(options.track_m / narrower, 5),
    }
    keep(args.config, measures)
    said = ", ".join(f"{name} = {value}" for name, value in measures.items())
    brick = f" --brick {args.brick}" if args.robot == "ev3-remote" else ""
    print(
        f"\nSaved in {args.config}: {said}.\nDrive with: "
        f"drivelesson serve --robot {args.robot}{brick} --config {quoted(str(args.config))}"
    )
    return 0


def _measure_straight(driver: ChassisDriver, seconds: float) -> float:
    """Drive straight on; return the ratio of the wheels' real size to the configured size."""
    room_cm = 100 * driver.options.forward_speed_mps * seconds
    _prompt(
        f"\nThe robot will drive straight on for about {room_cm:.0f} cm. Mark its position, "
        "then press Enter."
    )
    before_m = driver.sense().distance_m
    wheels_cm = 50 * sum(driver.roll(Action.FORWARD, seconds))
    after_m = driver.sense().distance_m
    seen = before_m - after_m if before_m is not None and after_m is not None else None
    by_sonar = f"; the ultrasonic sensor says: {100 * seen:.1f}" if seen else ""
    measured_cm = ask(f"How far did it go, in cm? (the wheels say: {wheels_cm:.1f}{by_sonar}) ")
    factor = correction(measured_cm, wheels_cm, "cm")
    print(f"Straight speed before this calibration: {measured_cm / seconds:.1f} cm/s.")
    return factor


def _measure_turn(driver: ChassisDriver, seconds: float, wider: float) -> float:
    """Turn left; return the ratio of the real angle to the angle computed from the wheels' turns.

    `wider` is the ratio that `_measure_straight` returned.
    """
    angle_deg = driver.options.turn_rate_deg_s * seconds
    _prompt(
        f"\nThe robot will turn left by about {angle_deg:.0f} degrees. Mark its direction, "
        "then press Enter."
    )
    left_m, right_m = driver.roll(Action.LEFT, seconds)
    wheels_deg = math.degrees(wider * (right_m - left_m) / driver.options.track_m)
    measured_deg = ask(f"How far did it turn, in degrees? (the wheels say: {wheels_deg:.0f}) ")
    factor = correction(measured_deg, wheels_deg, "degrees")
    print(f"Turning rate before this calibration: {measured_deg / seconds:.1f} degrees/s.")
    return factor


def correction(measured: float, expected: float, unit: str) -> float:
    """Return the ratio of the measured value to the value computed from the wheels' turns.

    Raises:
        ConfigurationError: If the wheels have not turned, or if the ratio is implausible.
    """
    if expected <= 0:
        raise ConfigurationError(
            f"the wheels measured {expected:.3g} {unit}: check --left-port, --right-port and "
            "--reversed-motors"
        )
    if not 1 / LARGEST_CORRECTION < measured / expected < LARGEST_CORRECTION:
        raise ConfigurationError(
            f"you measured {measured:.3g} {unit}, but the wheels measured {expected:.3g}; "
            "measure again"
        )
    return measured / expected


def ask(question: str) -> float:
    """Ask on the terminal until the answer is a number above 0; raise an error at end of input."""
    while True:
        try:
            number = float(_prompt(question).strip().replace(",", "."))
        except ValueError:
            number = 0.0
        if 0 < number < 100_000:
            return number
        print("Please type a number above 0.")


def _prompt(question: str) -> str:
    try:
        return input(question)
    except EOFError:
        raise ConfigurationError(
            "the command `calibrate` asks questions; run it in a terminal"
        ) from None


def keep(file: Path, values: Mapping[str, float]) -> None:
    """Set top-level values of a TOML file; all other lines, including comments, stay unchanged.

    Raises:
        ConfigurationError: If the file cannot be written, or if the change would alter any other
            setting.
    """
    with told_as(ConfigurationError, f"cannot write {file}", OSError, ValueError):
        text = file.read_text("utf-8-sig") if file.exists() else ""
        table = _TABLE.search(text)
        head, rest = (text[: table.start()], text[table.start() :]) if table else (text, "")
        for name, value in values.items():
            spelled = "[\"']?" + name.replace("_", "[_-]") + "[\"']?"
            head, n = re.subn(rf"(?m)^[ \t]*{spelled}[ \t]*=.*$", f"{name} = {value}", head)
            if n == 0:
                head += ("" if not head or head.endswith("\n") else "\n") + f"{name} = {value}\n"
        wanted, made = {**parse_settings(text), **values}, None
        with contextlib.suppress(TOMLDecodeError):
            made = parse_settings(head + rest)
        # These differ if, for example, a line of a multi-line string looks like a table's header.
        if made != wanted:
            lines = "; ".join(f"{name} = {value}" for name, value in values.items())
            raise ValueError(
                f"the file cannot be changed automatically; set these values yourself: {lines}"
            )
        write_whole(file, (head + rest).encode())
