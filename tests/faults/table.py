"""The table of faults, with the time in which the robot must stop after each fault."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from robot.testing import LinkConditions
from tests.kit.sizes import size

from .scenario import Change, Fault, FaultWorld

MODES = ("train", "intervention", "autonomous")
LIMIT_S = 0.5
"""Maximum time until the robot stands, in every mode, in seconds."""
SEEDS = size("SEEDS", 6, 1_000)
"""Number of drives in each cell of the table (1,000 with DRIVELESSON_FULL=1)."""


def _set(part: str, **values: object) -> Change:
    """Return a fault that changes attributes of one part of the world."""

    def change(world: FaultWorld) -> None:
        for name, value in values.items():
            setattr(getattr(world, part), name, value)

    return change


def _link(name: str, **conditions: Any) -> Fault:
    """Return a fault of the link, which ends when the conditions are ideal again."""
    begin, end = (_set("link", conditions=LinkConditions(**kept)) for kept in (conditions, {}))
    return Fault(name, begin, ("pilot_silent", "link_slow"), end)


_SILENCE, _SPEAK = (_set("page", is_silent=is_silent) for is_silent in (True, False))
_THAW = _set("camera", is_frozen=False)


def _hide(world: FaultWorld) -> None:
    world.page.hold(None)
    world.page.mode("stopped")
    world.page.is_silent = True


def _speak_late(world: FaultWorld) -> None:
    """A fault in which old messages arrive after the robot was told to stop."""
    world.page.is_silent = True
    world.page.hold(None)
    world.page.mode("stopped")
    world.page.send(type="drive", held="forward", frame=None, seq=2)
    world.page.send(type="mode", mode="train", seq=1)


def _is_picture_old(world: FaultWorld) -> bool:
    """True if the pilot sees a picture that is older than the governor allows."""
    frame = world.hub.broadcast.video.captured_s.get(world.page.picture or 0)
    return frame is not None and world.clock.now_s() - frame > 0.5


FAULTS = (
    Fault("the tab is closed", lambda world: world.page.close(), ("pilot_gone",)),
    Fault("the browser is killed", lambda world: world.page.vanish(), ("pilot_gone",)),
    Fault("the tab is hidden", _hide, ("pilot_asked",), _SPEAK),
    Fault(
        "the page hangs, or its tab is suspended", _SILENCE, ("pilot_silent", "link_slow"), _SPEAK
    ),
    Fault(
        "only the pictures' connection is closed",
        lambda world: world.page.close_pictures(),
        ("link_slow",),
    ),
    Fault(
        "pictures are no longer acknowledged",
        _set("page", acknowledges=False),
        ("link_slow",),
        _set("page", acknowledges=True),
    ),
    _link("the network falls silent", is_silent=True),
    _link("every packet is 0.6 s late, both ways", delay_s=0.6),
    replace(
        _link("each packet is late by a random time, up to 2 s", delay_s=0.3, jitter_s=2.0),
        counts_from_last_message=True,
        note="; time counted from the last message in time",
    ),
    _link("every packet is lost and sent again after 0.7 s", stall_share=1.0, stall_s=0.7),
    Fault("messages sent before a stop arrive after it", _speak_late, ("pilot_asked",), _SPEAK),
    replace(
        _link("the link slows down to 100 kbit/s", bytes_per_second=12_500.0),
        reasons=("link_slow", "pilot_silent"),
        counts_from=_is_picture_old,
        note="; time counted from when the picture is 500 ms old",
    ),
    Fault("the camera freezes", _set("camera", is_frozen=True), ("frame_stale",), _THAW),
    Fault(
        "the camera reports a fault",
        lambda world: world.camera.break_down("The camera was unplugged."),
        ("camera_fault",),
        _THAW,
    ),
    Fault(
        "the driver raises an error",
        _set("driver", failure="The left motor does not answer."),
        ("drive_fault",),
        _set("driver", failure=None),
    ),
    Fault(
        "the clock jumps an hour ahead",
        lambda world: world.clock.advance(3600.0),
        ("loop_fault", "pilot_silent", "frame_stale"),
    ),
)
