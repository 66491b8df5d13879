"""A QR code on a terminal is readable on every theme, or a sentence says why there is none."""

from __future__ import annotations

import io
import re

import cv2
import numpy as np
import pytest

from server.access.terminal_code import Terminal, draw_qr

ADDRESS = "http://192.168.178.123:8000/pair#ABCD-EFGH-JKMN-PQRS"
COLOURED = Terminal(100, has_colours=True, has_blocks=True)
PLAIN = Terminal(None, has_colours=False, has_blocks=True)

THEMES = {
    "black on white": ((0, 0, 0), (255, 255, 255)),
    "white on black": ((255, 255, 255), (0, 0, 0)),
    "solarized light": ((101, 123, 131), (253, 246, 227)),
    "solarized dark": ((131, 148, 150), (0, 43, 54)),
    "gruvbox light": ((60, 56, 54), (251, 241, 199)),
    "nord": ((216, 222, 233), (46, 52, 64)),
    "green screen": ((0, 255, 0), (0, 20, 0)),
}
"""The theme's text and background; a theme may also redefine the first sixteen colours."""
INK = {" ": (0, 0), "▀": (1, 0), "▄": (0, 1), "█": (1, 1)}
CUBE = {16: (0, 0, 0), 231: (255, 255, 255)}


def shown(text: str, theme: str, size: int = 8) -> np.ndarray:
    """Return the picture of a text on a terminal of this theme, with a margin."""
    colours = [*THEMES[theme]]
    columns = max(len(re.sub(r"\x1b\[[\d;]*m", "", line)) for line in text.splitlines())
    picture = np.empty((2 * text.count("\n") + 8, columns + 8, 3), np.uint8)
    picture[:] = THEMES[theme][1]
    for y, line in enumerate(text.splitlines()):
        x = 0
        for escape, character in re.findall(r"\x1b\[([\d;]*)m|(.)", line):
            if not character:
                numbers = [int(number) for number in escape.split(";")]
                if numbers == [0]:
                    colours = [*THEMES[theme]]
                while numbers[:2] in ([38, 5], [48, 5]):
                    colours[numbers[0] == 48] = CUBE[numbers[2]]
                    numbers = numbers[3:]
                continue
            for half, ink in enumerate(INK[character]):
                picture[4 + 2 * y + half, 4 + x] = colours[0] if ink else colours[1]
            x += 1
    return picture.repeat(size, axis=0).repeat(size, axis=1)


@pytest.mark.parametrize("theme", THEMES)
def test_a_coloured_code_is_read_on_every_theme(theme: str) -> None:
    picture = shown(draw_qr(ADDRESS, COLOURED), theme)
    assert cv2.QRCodeDetector().detectAndDecode(picture)[0] == ADDRESS


def test_without_colours_the_code_is_for_dark_windows() -> None:
    drawn = draw_qr(ADDRESS, PLAIN)
    assert "\x1b" not in drawn
    picture = shown(drawn, "white on black")
    assert cv2.QRCodeDetector().detectAndDecode(picture)[0] == ADDRESS


@pytest.mark.parametrize(
    ("terminal", "said"),
    [
        (Terminal(100, has_colours=True, has_blocks=False), "does not use UTF-8"),
        (Terminal(20, has_colours=True, has_blocks=True), "needs a window of 33 columns"),
    ],
)
def test_a_sentence_says_why_there_is_no_code(terminal: Terminal, said: str) -> None:
    drawn = draw_qr(ADDRESS, terminal)
    assert said in drawn and "▀" not in drawn and drawn.count("\n") == 1


class Stream(io.StringIO):
    def __init__(self, encoding: str, *, is_terminal: bool) -> None:
        super().__init__()
        self._encoding, self._is_terminal = encoding, is_terminal

    @property
    def encoding(self) -> str:  # type: ignore[override]
        return self._encoding

    def isatty(self) -> bool:
        return self._is_terminal


@pytest.mark.parametrize(
    ("environment", "system", "has_colours"),
    [
        ({"TERM": "xterm-256color"}, "linux", True),
        ({"TERM": "xterm-256color", "NO_COLOR": "1"}, "linux", False),
        ({"TERM": "xterm-256color", "NO_COLOR": ""}, "linux", True),
        ({"TERM": "dumb"}, "linux", False),
        ({}, "linux", False),
        ({}, "win32", False),
        ({"WT_SESSION": "1"}, "win32", True),
    ],
)
def test_colours_are_used_where_the_terminal_has_them(
    environment: dict[str, str], system: str, has_colours: bool
) -> None:
    terminal = Terminal.of(Stream("utf-8", is_terminal=True), environment, system)
    assert terminal == Terminal(None, has_colours=has_colours, has_blocks=True)
    piped = Terminal.of(Stream("utf-8", is_terminal=False), environment, system)
    assert piped == Terminal(None, has_colours=False, has_blocks=True)
    assert not Terminal.of(Stream("ascii", is_terminal=True), environment, system).has_blocks
