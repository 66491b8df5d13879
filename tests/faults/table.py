"""The faults, the required reaction in each mode, and the page of docs about them."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

from robot.testing import LinkConditions
from tests.kit.sizes import size

from . import bodies
from .scenario import Change, Fault, FaultWorld

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "faults.md"
MODES = ("train", "intervention", "autonomous")
LIMIT_S = {"train": 0.5, "intervention": 0.5, "autonomous": 0.5}
SEEDS = size("SEEDS", 6, 1_000)
"""Number of drives in each cell of the table (`.ci/run`: 1,000)."""


def _set(part: str, **values: object) -> Change:
    """Return a change of some attributes of a part of the world."""

    def change(world: FaultWorld) -> None:
        for name, value in values.items():
            setattr(getattr(world, part), name, value)

    return change


def _link(name: str, **conditions: Any) -> Fault:
    """Return a fault of the link, which ends when the conditions are ideal again."""
    begin, end = (_set("link", conditions=LinkConditions(**kept)) for kept in (conditions, {}))
    return Fault(name=name, begin=begin, end=end, reasons=("pilot_silent", "link_slow"))


_SILENCE, _SPEAK = (_set("page", is_silent=is_silent) for is_silent in (True, False))
_THAW = _set("camera", is_frozen=False)


def _hide(world: FaultWorld) -> None:
    world.page.hold(None)
    world.page.mode("stopped")
    world.page.is_silent = True


def _speak_late(world: FaultWorld) -> None:
    """Old messages arrive after the robot was told to stop."""
    world.page.is_silent = True
    world.page.hold(None)
    world.page.mode("stopped")
    world.page.send(type="drive", held="forward", frame=None, seq=2)
    world.page.send(type="mode", mode="train", seq=1)


def _is_picture_old(world: FaultWorld) -> bool:
    """True once the pilot sees a picture that is older than the governor allows."""
    frame = world.hub.broadcast.video.captured_s.get(world.page.picture or 0)
    return frame is not None and world.clock.now_s() - frame > 0.5


FAULTS = (
    Fault(
        name="the tab is closed", begin=lambda world: world.page.close(), reasons=("pilot_gone",)
    ),
    Fault(
        name="the browser is killed",
        begin=lambda world: world.page.vanish(),
        reasons=("pilot_gone",),
    ),
    Fault(name="the tab is hidden", begin=_hide, end=_SPEAK, reasons=("pilot_asked",)),
    Fault(
        name="the page hangs, or its tab is suspended",
        begin=_SILENCE,
        end=_SPEAK,
        reasons=("pilot_silent", "link_slow"),
    ),
    Fault(
        name="only the pictures' connection is closed",
        begin=lambda world: world.page.close_pictures(),
        reasons=("link_slow",),
    ),
    Fault(
        name="pictures are no longer acknowledged",
        begin=_set("page", acknowledges=False),
        end=_set("page", acknowledges=True),
        reasons=("link_slow",),
    ),
    _link("the network falls silent", is_silent=True),
    _link("every packet is 0.6 s late, both ways", delay_s=0.6),
    replace(
        _link("packets are up to 2 s late, each by a random time", delay_s=0.3, jitter_s=2.0),
        counts_from_last_message=True,
        note=", counted from the last message that came in time",
    ),
    _link("every packet is lost and sent again after 0.7 s", stall_share=1.0, stall_s=0.7),
    Fault(
        name="messages from before a stop arrive after it",
        begin=_speak_late,
        end=_SPEAK,
        reasons=("pilot_asked",),
    ),
    replace(
        _link("the line narrows to 100 kbit/s", bytes_per_second=12_500.0),
        reasons=("link_slow", "pilot_silent"),
        counts_from=_is_picture_old,
        note=", counted from when the picture is 500 ms old",
    ),
    Fault(
        name="the camera freezes",
        begin=_set("camera", is_frozen=True),
        end=_THAW,
        reasons=("frame_stale",),
    ),
    Fault(
        name="the camera reports a fault",
        begin=lambda world: world.camera.break_down("The camera was unplugged."),
        end=_THAW,
        reasons=("camera_fault",),
    ),
    Fault(
        name="the drive raises",
        begin=_set("driver", failure="The left motor does not answer."),
        end=_set("driver", failure=None),
        reasons=("drive_fault",),
    ),
    Fault(
        name="the clock jumps an hour ahead",
        begin=lambda world: world.clock.advance(3600.0),
        reasons=("loop_fault", "pilot_silent", "frame_stale"),
    ),
)

ELSEWHERE = (
    (
        "the server is frozen (SIGSTOP) for a second",
        "`loop_fault` or `link_slow`",
        "500 ms: the body's own limit",
    ),
    ("the disk is full", "drives on; stands when the pilot lets go", "500 ms"),
)
"""Faults with tests in tests/faults/ that need a separate process."""


def render(measured_ms: dict[tuple[str, str], float]) -> str:
    """Return the page; a cell contains figures if a run has measured them (`figures`)."""
    head = "| fault | in `train` | in intervention | in `autonomous` | the robot says |"
    lines = [*_INTRODUCTION, "", head, "|---|---|---|---|---|"]
    for fault in FAULTS:
        cells = [_cell(fault, mode, measured_ms) for mode in MODES]
        reasons = " or ".join(f"`{reason}`" for reason in fault.reasons)
        lines.append(f"| {fault.name}{fault.note} | {' | '.join(cells)} | {reasons} |")
    lines += ["", "Faults of a whole process:", "", "| fault | the robot | within |"]
    lines += ["|---|---|---|", *(f"| {a} | {b} | {c} |" for a, b, c in ELSEWHERE)]
    lines += ["", *_BODIES_INTRODUCTION, "", f"| body | {' | '.join(bodies.FAULTS)} | by |"]
    lines.append("|" + "---|" * (len(bodies.FAULTS) + 2))
    for name, (_, by) in bodies.BODIES.items():
        cells = [_body_cell(name, fault, measured_ms) for fault in bodies.FAULTS]
        lines.append(f"| `{name}` | {' | '.join(cells)} | {by} |")
    lines += [f"| {name} | {said} | {said} | {said} | {by} |" for name, said, by in bodies.OTHERS]
    return "\n".join([*lines, "", *_CLOSING]) + "\n"


def figures(page: str) -> dict[tuple[str, str], float]:
    """Return the figures in the page, by row and column."""
    rows = {f"{fault.name}{fault.note}": (fault.name, MODES) for fault in FAULTS}
    rows |= {f"`{name}`": (name, tuple(bodies.FAULTS)) for name in bodies.BODIES}
    found = {}
    for line in page.splitlines():
        first, *cells = line.strip("| ").split(" | ")
        name, columns = rows.get(first, ("", ()))
        for column, cell in zip(columns, cells, strict=False):
            if figure := re.search(r"\((\d+)\)", cell):
                found[name, column] = float(figure[1])
    return found


def _cell(fault: Fault, mode: str, measured_ms: dict[tuple[str, str], float]) -> str:
    figure = measured_ms.get((fault.name, mode))
    limit = f"{1000 * LIMIT_S[mode]:.0f} ms"
    return f"stands within {limit}" + ("" if figure is None else f" ({figure:.0f})")


def _body_cell(name: str, fault: str, measured_ms: dict[tuple[str, str], float]) -> str:
    figure = measured_ms.get((name, fault))
    limit = f"stands within {1000 * bodies.STANDS_S:.0f} ms"
    return limit + ("" if figure is None else f" ({figure:.0f})")


_INTRODUCTION = [
    "# Faults",
    "",
    "This page says what the robot does at each fault, in each mode. `make docs` writes the page,",
    "and the tests check its table in every run. For the table, a pilot drives a robot over a",
    "link, in virtual time. The server's hub, protocol, control loop and gate are the real ones.",
    "The camera gives 10 to 30 pictures a second, and the fault occurs at a random moment. The",
    "number in brackets is the longest time of 1,000 such drives, in milliseconds; it is the same",
    "in every run, on every machine. The tests repeat the drives with proportional steering, and",
    "the robot stops within the same times.",
]
_BODIES_INTRODUCTION = [
    "## Each body, when its server is gone",
    "",
    "When the server is gone, only the body itself can stop the robot. For this table, the real",
    "driver and the real firmware of each body run in virtual time. Messages between them are",
    "delayed by up to 80 ms, and around the time of the fault by up to 1.2 s. Some bodies differ:",
    "",
    "- `ev3-stock` and `lego-education`: LEGO's firmware cannot detect a late command. For these",
    "  bodies, the table therefore assumes that messages are delayed by at most 50 ms around the",
    "  time of the fault.",
    "- `ev3-remote`: messages have no delay. The brick refuses late commands, as its agent's",
    "  own tests show.",
    "- `ev3`: messages have no delay, because they are sent over the motors' cables.",
    "- `ros`: the robot's base has no timeout of its own.",
    "",
    f"We measured {bodies.DRIVES} drives for each cell. The number in brackets is the longest time",
    "from the fault until the body stood still, in milliseconds.",
]
_CLOSING = [
    "After each fault the robot waits for an explicit start: it never moves by itself when a",
    "fault ends. In `autonomous`, while the pilot holds no direction, the page's heartbeat",
    "shows that the pilot is present.",
    "",
    "The tests in tests/e2e/ repeat some faults with a real Chromium: a closed tab, a blocked",
    "page, a killed browser, a silent link, and a hidden page.",
]
