"""Write a driver package of three files for your own robot; the driver already passes its tests."""

from __future__ import annotations

import argparse
import re
from importlib.resources import files
from pathlib import Path

from robot.devices.plugins import driver_names
from robot.errors import ConfigurationError, told_as

_FILES = ("pyproject.toml", "drivelesson_mybot.py", "conftest.py")
_NAME = re.compile(r"[a-z][a-z0-9]{1,20}")


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("name", metavar="NAME", help="robot's name: lower-case letters and digits")
    parser.add_argument(
        "--out", type=Path, default=None, help="folder to create (default: drivelesson-NAME)"
    )


def run(args: argparse.Namespace) -> int:
    name: str = args.name
    if _NAME.fullmatch(name) is None:
        raise ConfigurationError(
            f"{name!r} is not a valid robot name: use a lower-case letter, then 1 to 20 lower-case "
            "letters or digits, as in: drivelesson new-driver wheely"
        )
    if name in driver_names():
        raise ConfigurationError(f"the robot {name!r} exists already; choose another name")
    folder: Path = args.out or Path(f"drivelesson-{name}")
    template = files("robot.bodies.mybot")
    if folder.exists():
        raise ConfigurationError(f"{folder} exists already; choose another with --out")
    with told_as(ConfigurationError, f"cannot write {folder}"):
        folder.mkdir(parents=True)
        for file in _FILES:
            text = template.joinpath(file).read_text(encoding="utf-8")
            text = text.replace("mybot", name).replace("Mybot", name.capitalize())
            (folder / file.replace("mybot", name)).write_text(text, encoding="utf-8")
    print(f"{folder} contains a driver for {name!r}. Try it:")
    print(f"  pip install -e {folder}")
    print(f"  cd {folder} && pytest --drivelesson-driver {name}")
    print(f"  drivelesson serve --robot {name} --{name}-address HOST:PORT --lan --tls")
    return 0
