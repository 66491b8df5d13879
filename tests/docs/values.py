"""Writes the program's own numbers into the documents: `make docs`.

A page marks such a number by two invisible comments:

    within <!--= gate.pilot_timeout_s -->0.3 s<!--/--> the robot stands

A marker contains the name of a constant, or of a setting below. A number whose name ends in `_s` or
`_S` is written in seconds, or in milliseconds after `ms`; `bare` leaves the unit out. To change a
number, change it in the code, and run `make docs`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

from robot import driver, moves
from robot.coaching import lesson, trial_drive
from robot.control.config import CameraTimingConfig, GateConfig, LinkGovernorConfig
from robot.policy import history
from robot.policy.registry import DEFAULT_NODES
from server.access.config import NetworkLimits

ROOT = Path(__file__).parents[2]
_MARK = re.compile(r"(<!--= ([\w.]+)(?: (ms|bare))? -->)(.*?)(<!--/-->)")

SOURCES: Mapping[str, object] = {
    "driver": driver,
    "moves": moves,
    "history": history,
    "lesson": lesson,
    "trial_drive": trial_drive,
    "gate": GateConfig(),
    "governor": LinkGovernorConfig(),
    "patience": CameraTimingConfig(),
    "limits": NetworkLimits(),
    "learner": SimpleNamespace(default=f"default-{DEFAULT_NODES}", nodes=DEFAULT_NODES),
    "ros_topics": import_module("robot.bodies.ros.topics"),
    "remote": import_module("robot.bodies.remote.driver"),
    "ev3_stock": import_module("robot.bodies.ev3.stock.lines"),
    "lego_education": import_module("robot.bodies.lego_education.driver"),
}
"""The sources from which a page may take a number."""


def pages() -> list[Path]:
    """Return every page that may have markers."""
    return sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])


def names(text: str) -> list[str]:
    """Return the names that a page takes from the program."""
    return [name for _, name, _, _, _ in _MARK.findall(text)]


def fill(text: str, sources: Mapping[str, object] = SOURCES) -> str:
    """Return a page with the current numbers.

    Raises:
        KeyError: If there is no such source.
        AttributeError: If the source has no such constant.
    """
    return _MARK.sub(lambda mark: mark[1] + _written(mark[2], mark[3], sources) + mark[5], text)


def _written(name: str, form: str | None, sources: Mapping[str, object]) -> str:
    source, _, attribute = name.partition(".")
    value = getattr(sources[source], attribute)
    if isinstance(value, str):
        return value
    if form == "ms":
        return f"{1000 * value:g} ms"
    unit = " s" if attribute.lower().endswith("_s") and form != "bare" else ""
    return f"{value:.12g}{unit}"
