"""The drive screen does not move, whatever message it shows, at any size and in any language.

STOP is completely on the screen and on top, no control moves, no texts overlap, and no tap hits a
control that appeared after the finger had aimed. `make test` measures each size once, in one
language; at full size each is measured in every language. DRIVELESSON_SIZES=all measures a grid of
sizes in every language, each with another size of text.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from robot.types import StopReason
from tests.kit.sizes import IS_FULL

from .boxes import MEASURE, in_language, sized
from .world import LANDSCAPE, PHONE, World, open_page, running_world, sentences, show

pytestmark = pytest.mark.timeout(3600)

_SCRIPT = (Path(__file__).parent / "still.js").read_text()
SHOW_ALL = _SCRIPT[_SCRIPT.index("async (") :].replace("MEASURE", MEASURE)
SIZES = [
    *((280, 480), (345, 740), (360, 640), (390, 844), (480, 280), (640, 360), (844, 390)),
    *((600, 520), (768, 1024), (1024, 600), (1280, 800)),
]
ROOMY = ("360x640", "390x844", "844x390", "768x1024", "1024x600", "1280x800")
"""A size at which every sentence fits; at other sizes some sentences have to be scrolled."""
_WIDTHS = (280, 320, 345, 369, 390, 430, 480, 540, 653, 700, 768, 900, 1024, 1280)
_HEIGHTS = (480, 520, 568, 640, 701, 765, 844, 1024, 1280)
GRID = sorted({(w, h) for a, b in product(_WIDTHS, _HEIGHTS) for w, h in ((a, b), (b, a))})
IS_WHOLE = os.environ.get("DRIVELESSON_SIZES") == "all"
THREE = ["forward", "left", "right"]
SIX = [*THREE, "backward", "spin_left", "spin_right"]
PADS = [("three", "en"), ("three", "es"), ("three", "zh"), ("six", "es"), ("stick", "es")]
SAID = re.compile(
    r"^(advice|setback|local|stop|link|busy|lag|hint|session\.next|session\.now)[._]"
    r"|^(asks|wheel_|viewer|emergency|stopped_by\.|out_of_reach|connecting|choose_|start_stale)"
    r"|^(searching|session\.questions|challenge\.(armed|left)|way\..*)$"
)
"""The messages that the drive screen may show."""
ELSEWHERE = {"emergency_stop", "stop.pilot_asked"}


@pytest.fixture(scope="module")
def standing(tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    folder = tmp_path_factory.mktemp("standing")
    with running_world(folder, world="office", frame_rate_hz=3.0) as running:
        yield running


@pytest.mark.parametrize(("moves", "language"), PADS)
def test_the_drive_screen_holds_still(
    chromium: Any, standing: World, language: str, moves: str
) -> None:
    # The jump of the celebrating figure does not count, because the figure is not a control.
    context = in_language(chromium, language)
    page = open_page(context, standing.address)
    # makes the page fetch the sentences of studies
    for screen in ("study", "challenge", "drive"):
        show(page, screen)
    words = sentences(language)
    wrong: list[str] = []
    said: set[str] = set()
    for seed, size in enumerate(sized(page, _sizes(PADS.index((moves, language)))), 1):
        given = {
            "stopReasons": [reason.value for reason in StopReason],
            "links": [key.split(".")[1] for key in words if key.startswith("link.")],
            "phases": ["teach", "correct", "alone"],
            "moves": SIX if moves == "six" else THREE,
            "hasStick": moves == "stick",
            "seed": 1000 * seed + 7,
        }
        shown = page.evaluate(SHOW_ALL, given)
        wrong += [f"{size}: {fault}" for fault in shown["found"]]
        said |= set(shown["said"])
        if size in [f"{roomy} 100 %" for roomy in ROOMY]:
            wrong += [f"{size}: has no room for {one!r}" for one in shown["scrolled"]]
    context.close()
    assert not wrong, "\n".join(dict.fromkeys(wrong))
    assert unsaid(words, said) == []


def _sizes(turn: int) -> list[tuple[tuple[int, int], int]]:
    """Return screens with text sizes in percent, for one of the `PADS`."""
    if IS_WHOLE:
        return [(size, (100, 130, 160, 200)[(i + turn) % 4]) for i, size in enumerate(GRID)]
    every = [(size, 100 + 100 * (i % 2)) for i, size in enumerate(SIZES)]
    return list(product(SIZES, (100, 200))) if IS_FULL else every[turn :: len(PADS)]


def unsaid(words: dict[str, str], said: set[str]) -> list[str]:
    """List the messages of the drive screen that no state has shown."""
    missing = []
    for key, sentence in words.items():
        if not SAID.match(key) or key in ELSEWHERE:
            continue
        pattern = re.compile(".*".join(map(re.escape, re.split(r"\{\w+\}", sentence))))
        if not any(pattern.fullmatch(one) for one in said):
            missing.append(key)
    return missing


WRONGLY_HIT = """(n) => {
  const moves = Array.from({ length: n }, (_, i) => `wave_${i}`);
  const { page } = document.querySelector('app-bar');
  page.follow = () => {};
  const rest = { icon: '', does: '', steering: null, throttle: null };
  page.greet({ role: 'pilot', robot: 'Rover', moves, declared_moves: moves.map((name, i) => (
    { name, label: { en: `Wave with both hands ${i}` }, ...rest })) });
  const buttons = [...document.querySelectorAll('drive-pad .move')];
  return buttons.flatMap((button) => {
    const { left, top, width, height } = button.getBoundingClientRect();
    return [0.2, 0.5, 0.8]
      .flatMap((u) => [0.05, 0.5, 0.95].map((v) => [left + u * width, top + v * height]))
      .filter(([x, y]) => document.elementFromPoint(x, y)?.closest('.move, .stop') !== button)
      .map(() => button.textContent);
  });
}"""


def test_no_moves_label_covers_another_move(chromium: Any, standing: World) -> None:
    """The page has a robot of its own, because its finger drives."""
    context = in_language(chromium, "en")
    page = open_page(context, standing.address)
    for size in (PHONE, LANDSCAPE, {"width": 320, "height": 568}):
        page.set_viewport_size(size)
        for moves in (5, 12):
            assert page.evaluate(WRONGLY_HIT, moves) == [], (size, moves)
    context.close()
