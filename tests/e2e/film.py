"""Films ten seconds for the README: a pilot teaches, hands over and corrects."""

from __future__ import annotations

import io
import itertools
import time
from pathlib import Path
from typing import Any

from robot.types import Mode

from .hand import Fingers, choose, pad, teach
from .world import PHONE, World, open_page, passing_world

_SIZE_PX, _MOST_BYTES, _LONGEST_S = (312, 675), 2_000_000, 0.3
_TURNS_AT_M = (0.35, 0.3, 0.4, 0.35, 0.25, 0.35, 0.3, 0.4, 0.3)
"""Distances of the pilot's turns; with equal distances, the robot would ask for help at others."""
_ASKED_SHARE = 0.1


def take_film(browser: Any, folder: Path) -> None:
    """Write `ten-seconds.webp`. If a busy machine stops the robot meanwhile, the film begins
    again."""
    for _ in range(5):
        with passing_world("box") as world:
            if _film(browser, world, folder / "ten-seconds.webp"):
                return


def _film(browser: Any, world: World, path: Path) -> bool:
    """Film ten seconds of the drive screen, in which the pilot teaches, hands over and corrects.
    Return True if the film is complete and the robot hardly asked for help."""
    context = browser.new_context(
        viewport=PHONE, has_touch=True, is_mobile=True, reduced_motion="no-preference"
    )
    page = open_page(context, world.address)
    fingers, frames, asked = Fingers(page), [], []

    def take() -> float:
        frames.append((time.monotonic(), page.screenshot(type="jpeg", quality=90)))
        asked.append(world.rig.loop.state.decision.asks_pilot)
        return frames[-1][0]

    def roll(seconds: float) -> None:
        ends_s = time.monotonic() + seconds
        while take() < ends_s:
            page.wait_for_timeout(100)

    choose(page, world, Mode.TRAIN)
    for turn_at_m in _TURNS_AT_M:
        teach(world, fingers, world.lessons + 100, near_m=turn_at_m)
    ends_s = time.monotonic() + 3.0
    teach(world, fingers, 10_000, near_m=0.4, until=lambda: take() > ends_s)
    teach(world, fingers, 10_000, near_m=0.4, until=lambda: world.distance_m > 0.5)
    choose(page, world, Mode.AUTONOMOUS)
    roll(3.5)
    fingers.press(pad("left"))
    roll(1.5)
    fingers.lift()
    roll(2.0)
    is_whole = world.mode is Mode.AUTONOMOUS
    context.close()
    if is_whole:
        _save_film(frames, path)
    return is_whole and sum(asked) <= _ASKED_SHARE * len(asked)


def _save_film(frames: list[tuple[float, bytes]], path: Path) -> None:
    """Write a film with the times at which its pictures were taken, small enough for a README."""
    from PIL import Image

    pictures = [Image.open(io.BytesIO(data)).resize(_SIZE_PX) for _, data in frames]
    times_s = [at_s for at_s, _ in frames]
    # A longer gap without a picture is a cut.
    spans_s = [min(b - a, _LONGEST_S) for a, b in itertools.pairwise(times_s)]
    shown_ms = [round(1000 * span_s) for span_s in spans_s] + [800]
    first, *others = pictures
    first.save(
        path, save_all=True, append_images=others, duration=shown_ms, loop=0, quality=60, method=4
    )
    assert path.stat().st_size < _MOST_BYTES, f"{path} has {path.stat().st_size} bytes"
    print(path)
