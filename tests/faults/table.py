"""The faults, what the robot must do in each mode, and the page of docs that says so."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from server.bench.proxy import LinkConditions

from .world import Change, Condition, World

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "faults.md"
MODES = ("train", "intervention", "autonomous")
LIMIT_S = {"train": 0.5, "intervention": 0.5, "autonomous": 0.5}


@dataclass(frozen=True, kw_only=True)
class Fault:
    """One thing that goes wrong, and comes right again."""

    name: str
    begin: Change
    end: Change = lambda world: None
    reasons: tuple[str, ...]
    """Why the robot may say that it stands."""
    counts_from: Condition | None = None
    """What has to be so before the robot must stand; None: it must from the beginning."""
    counts_from_last_word: bool = False
    """Chance lets some words through in time: the robot must stand so long after the last one."""
    note: str = ""


def _silence(world: World) -> None:
    world.pilot.is_silent = True


def _speak(world: World) -> None:
    world.pilot.is_silent = False


def _weather(**fields: object) -> Change:
    def change(world: World) -> None:
        world.proxy.conditions = LinkConditions(**fields)  # type: ignore[arg-type]

    return change


def _clear(world: World) -> None:
    world.proxy.conditions = LinkConditions()


def _hide(world: World) -> None:
    world.pilot.hold(None)
    world.pilot.mode("stopped")
    world.pilot.is_silent = True


def _freeze_camera(world: World) -> None:
    world.server.camera.is_frozen = True


def _break_camera(world: World) -> None:
    world.server.camera.break_down("The camera was unplugged.")


def _mend_camera(world: World) -> None:
    world.server.camera.is_frozen = False


def _break_drive(world: World) -> None:
    world.server.driver.failure = "The left motor does not answer."


def _mend_drive(world: World) -> None:
    world.server.driver.failure = None


def _jump(world: World) -> None:
    world.clock.ahead_s += 3600.0


def _speak_late(world: World) -> None:
    """A word of the past comes after the robot was told to stop."""
    world.pilot.is_silent = True
    world.pilot.hold(None)
    world.pilot.mode("stopped")
    world.pilot.send(type="drive", held="forward", frame=None, seq=2)
    world.pilot.send(type="mode", mode="train", seq=1)


def _is_picture_old(world: World) -> bool:
    """True once the pilot looks at a picture that is older than what the governor allows."""
    frame = world.server.hub.video.captured_s(world.pilot.picture or 0)
    return frame is not None and world.clock.now_s() - frame > 0.5


FAULTS = (
    Fault(
        name="the tab is closed",
        begin=lambda world: world.pilot.close(),
        reasons=("pilot_gone",),
    ),
    Fault(
        name="the browser is killed",
        begin=lambda world: world.pilot.vanish(),
        reasons=("pilot_gone",),
    ),
    Fault(name="the tab is hidden", begin=_hide, end=_speak, reasons=("pilot_asked",)),
    Fault(
        name="the page hangs, or its tab is suspended",
        begin=_silence,
        end=_speak,
        reasons=("pilot_silent",),
    ),
    Fault(
        name="the network falls silent",
        begin=_weather(is_silent=True),
        end=_clear,
        reasons=("pilot_silent",),
    ),
    Fault(
        name="every packet is 0.6 s late, both ways",
        begin=_weather(delay_s=0.6),
        end=_clear,
        reasons=("pilot_silent", "link_slow"),
    ),
    Fault(
        name="packets are up to 2 s late, each as it happens",
        begin=_weather(delay_s=0.3, jitter_s=2.0),
        end=_clear,
        reasons=("pilot_silent", "link_slow"),
        counts_from_last_word=True,
        note=", counted from the last word that came in time",
    ),
    Fault(
        name="every packet is lost and sent again after 0.7 s",
        begin=_weather(stall_share=1.0, stall_s=0.7),
        end=_clear,
        reasons=("pilot_silent", "link_slow"),
    ),
    Fault(
        name="words of the past come after a stop",
        begin=_speak_late,
        end=_speak,
        reasons=("pilot_asked",),
    ),
    Fault(
        name="the line narrows to 100 kbit/s",
        begin=_weather(bytes_per_second=12_500.0),
        end=_clear,
        reasons=("link_slow", "pilot_silent"),
        counts_from=_is_picture_old,
        note=", counted from when the picture is 500 ms old",
    ),
    Fault(
        name="the camera freezes",
        begin=_freeze_camera,
        end=_mend_camera,
        reasons=("frame_stale",),
    ),
    Fault(
        name="the camera reports a fault",
        begin=_break_camera,
        end=_mend_camera,
        reasons=("camera_fault",),
    ),
    Fault(name="the drive raises", begin=_break_drive, end=_mend_drive, reasons=("drive_fault",)),
    Fault(
        name="the clock jumps an hour ahead",
        begin=_jump,
        reasons=("loop_fault", "pilot_silent", "frame_stale"),
    ),
)

ELSEWHERE = (
    ("the server is frozen (SIGSTOP) for a second", "`loop_fault`", "500 ms: the body's own limit"),
    ("the disk is full", "drives on; stands when the pilot lets go", "500 ms"),
)
"""Faults with tests of their own in tests/faults/, which need a process of their own."""


def render(measured_ms: dict[tuple[str, str], float]) -> str:
    """Return the page; figures where a run has measured them."""
    head = "| fault | in `train` | in intervention | in `autonomous` | the robot says |"
    lines = [*_INTRODUCTION, "", head, "|---|---|---|---|---|"]
    for fault in FAULTS:
        cells = [_cell(fault, mode, measured_ms) for mode in MODES]
        reasons = " or ".join(f"`{reason}`" for reason in fault.reasons)
        lines.append(f"| {fault.name}{fault.note} | {' | '.join(cells)} | {reasons} |")
    lines += ["", "With a process of their own:", "", "| fault | the robot | within |"]
    lines += ["|---|---|---|", *(f"| {a} | {b} | {c} |" for a, b, c in ELSEWHERE)]
    return "\n".join([*lines, "", *_CLOSING]) + "\n"


def without_figures(page: str) -> str:
    """Return the page without what differs from run to run."""
    return re.sub(r" \(\d+\)", "", page)


def _cell(fault: Fault, mode: str, measured_ms: dict[tuple[str, str], float]) -> str:
    figure = measured_ms.get((fault.name, mode))
    limit = f"{1000 * LIMIT_S[mode]:.0f} ms"
    return f"stands within {limit}" + ("" if figure is None else f" ({figure:.0f})")


_INTRODUCTION = [
    "# Faults",
    "",
    "What the robot does when something goes wrong, in each mode. Written by the tests",
    "(`DRIVELESSON_WRITE_DOCS=1 pytest tests/faults`), which check every row in every run: a pilot",
    "drives a robot through a proxy that makes the weather. In brackets the milliseconds that the",
    "last such run measured, on two busy cores.",
]
_CLOSING = [
    "After each of them the robot waits for an explicit start: it never moves by itself when a",
    "fault ends. In `autonomous` with nothing held, the page's heartbeat is the supervision.",
    "",
    "The same with a real Chromium (a closed tab, a blocked page, a killed browser, a silent",
    "link, a hidden page) is in tests/e2e/.",
]
