"""Measure the robot's straight speed and turning rate by driving, and keep the measures."""

from __future__ import annotations

import argparse
import os
import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from robot.bodies.ev3.calibration import fit_track, fit_wheels, rolled_m, turned_deg
from robot.bodies.ev3.chassis import ChassisDriver, ChassisOptions
from robot.devices.options import make_options, options_of
from robot.devices.plugins import load_driver
from robot.driver import ACTION_TIMEOUT_S
from robot.errors import ConfigurationError
from robot.store.folder import write_whole
from robot.types import Action
from server.cli.parser import number
from server.cli.settings import PREFIX, apply_to, read_settings

ROBOTS = ("ev3", "ev3-remote")
_TABLE = re.compile(r"^\s*\[", re.MULTILINE)


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options of every robot."""
    parser.add_argument("--robot", default="ev3", choices=ROBOTS, help="which (default: ev3)")
    parser.add_argument(
        "--config",
        type=Path,
        default=Path(os.environ.get(PREFIX + "CONFIG", "drivelesson.toml")),
        help="TOML file of settings that is read and written (default: %(default)s)",
    )
    parser.add_argument(
        "--straight-s",
        type=number(above=0),
        default=4.0,
        help="seconds of driving (default: %(default)s)",
    )
    parser.add_argument(
        "--turn-s",
        type=number(above=0),
        default=9.75,
        help="seconds of turning (default: %(default)s)",
    )


def extend(parser: argparse.ArgumentParser, words: Sequence[str]) -> None:
    """Declare the chosen robot's options, and take the file's settings as defaults."""
    args, _ = parser.parse_known_args(list(words))
    settings = read_settings(args.config if args.config.exists() else None, os.environ)
    names = set()
    for option in options_of(load_driver(args.robot).options_type):
        parser.add_argument(option.flag, dest=option.name, default=None, help=option.help)
        names.add(option.name)
    known = {name: value for name, value in settings.flags.items() if name in names}
    apply_to(parser, replace(settings, flags=known, environ={}))


def run(args: argparse.Namespace) -> int:
    """Drive, ask for the measured distance and angle, and write the results."""
    driver_type = load_driver(args.robot)
    driver = driver_type(make_options(driver_type.options_type, vars(args)))
    assert isinstance(driver, ChassisDriver)
    with driver:
        options = _measure_straight(driver, args.straight_s)
        options = _measure_turn(driver, options, args.turn_s)
    keep(args.config, {"wheel_diameter_m": options.wheel_diameter_m, "track_m": options.track_m})
    print(
        f"\nKept in {args.config}: wheel_diameter_m = {options.wheel_diameter_m}, "
        f"track_m = {options.track_m}.\n"
        f"Drive with: drivelesson serve --robot {args.robot} --config {args.config}"
    )
    return 0


def _measure_straight(driver: ChassisDriver, seconds: float) -> ChassisOptions:
    options = driver.options
    room_cm = 100 * options.forward_speed_mps * seconds
    _prompt(
        f"\nThe robot will drive straight on for about {room_cm:.0f} cm. Mark its place, and press "
        "Enter."
    )
    before_m = driver.sense().distance_m
    left, right = drive(driver, Action.FORWARD, seconds)
    after_m = driver.sense().distance_m
    wheel_deg = (left + right) / 2
    seen = before_m - after_m if before_m is not None and after_m is not None else None
    by_sonar = f"; by the ultrasonic sensor: {100 * seen:.1f}" if seen else ""
    wheels_cm = 100 * rolled_m(wheel_deg, options)
    measured_cm = ask(f"How far did it go, in cm? (by the wheels: {wheels_cm:.1f}{by_sonar}) ")
    fitted = fit_wheels(options, wheel_deg, measured_cm / 100)
    print(f"Straight speed: {measured_cm / seconds:.1f} cm/s until now.")
    return fitted


def _measure_turn(driver: ChassisDriver, options: ChassisOptions, seconds: float) -> ChassisOptions:
    angle_deg = options.turn_rate_deg_s * seconds
    _prompt(
        f"\nThe robot will turn left by about {angle_deg:.0f} degrees. Mark where it looks, and "
        "press Enter."
    )
    left, right = drive(driver, Action.LEFT, seconds)
    wheels_deg = turned_deg(left, right, options)
    measured_deg = ask(f"How far did it turn, in degrees? (by the wheels: {wheels_deg:.0f}) ")
    fitted = fit_track(options, left, right, measured_deg)
    print(f"Turning rate: {measured_deg / seconds:.1f} degrees/s until now.")
    return fitted


def drive(
    driver: ChassisDriver,
    action: Action,
    seconds: float,
    now_s: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> tuple[float, float]:
    """Drive for some seconds; return how far each wheel turned, in degrees, forward positive.

    The command is sent again and again, so that the robot stops if this program does.
    """
    sign = -1 if driver.options.reversed_motors else 1
    before = driver.wheel_positions_deg()
    end_s = now_s() + seconds
    try:
        while (left_s := end_s - now_s()) > 0:
            driver.send_action(action)
            sleep(min(ACTION_TIMEOUT_S / 4, left_s))
    finally:
        driver.stop()
    sleep(0.3)  # until it has rolled out
    after = driver.wheel_positions_deg()
    return sign * (after[0] - before[0]), sign * (after[1] - before[1])


def ask(question: str) -> float:
    """Ask until the answer is a number above 0; the end of input is an error."""
    while True:
        try:
            number = float(_prompt(question).strip().replace(",", "."))
        except ValueError:
            number = 0.0
        if 0 < number < 100_000:
            return number
        print("A number above 0, please.")


def _prompt(question: str) -> str:
    try:
        return input(question)
    except EOFError:
        raise ConfigurationError("calibrate asks questions; run it in a terminal") from None


def keep(file: Path, values: Mapping[str, float]) -> None:
    """Set values at the head of a TOML file; all other lines, comments too, stay unchanged.

    Raises:
        ConfigurationError: If the file cannot be written.
    """
    try:
        text = file.read_text() if file.exists() else ""
        table = _TABLE.search(text)
        head, rest = (text[: table.start()], text[table.start() :]) if table else (text, "")
        for name, value in values.items():
            spelled = name.replace("_", "[_-]")
            head, n = re.subn(rf"(?m)^\s*{spelled}\s*=.*$", f"{name} = {value}", head)
            if n == 0:
                head += ("" if not head or head.endswith("\n") else "\n") + f"{name} = {value}\n"
        write_whole(file, (head + rest).encode())
    except OSError as error:
        raise ConfigurationError(f"cannot write {file}: {error.strerror}") from error
