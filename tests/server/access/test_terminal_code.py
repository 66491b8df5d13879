"""A terminal shows a QR code that is readable on every theme, or says why it shows none."""

import io
import re
import sys

import cv2
import numpy as np
import pytest

from server.access.terminal_code import Terminal, draw_qr

ADDRESS = "http://192.168.178.123:8000/pair#ABCD-EFGH-JKMN-PQRS"
THEMES = {
    "black on white": ((0, 0, 0), (255, 255, 255)),
    "white on black": ((255, 255, 255), (0, 0, 0)),
    "solarized dark": ((131, 148, 150), (0, 43, 54)),
}
"""The theme's text and background; a theme may also redefine the first sixteen colours."""
INK = {" ": (0, 0), "▀": (1, 0), "▄": (0, 1), "█": (1, 1)}
COLOURS = "\x1b[38;5;16;48;5;231m"
"""Black and white of the 256-colour cube, which no theme changes."""


def shown(text: str, theme: str) -> np.ndarray:
    """Return the picture of a code on a terminal with this theme, with a margin."""
    ink, paper = THEMES[theme]
    plain = re.sub(r"\x1b\[[\d;]*m", "", text).splitlines()
    halves = [[INK[letter][half] for letter in line] for line in plain for half in (0, 1)]
    if COLOURS in text:
        assert all(line.startswith(COLOURS) for line in text.splitlines())
        code = np.where(np.array(halves)[..., None], (0, 0, 0), (255, 255, 255))
    else:
        code = np.where(np.array(halves)[..., None], ink, paper)
    height, width, _ = code.shape
    picture = np.empty((height + 8, width + 8, 3), np.uint8)
    picture[:] = paper
    picture[4:-4, 4:-4] = code
    return picture.repeat(8, axis=0).repeat(8, axis=1)


@pytest.mark.parametrize(
    ("has_colours", "theme"), [*((True, theme) for theme in THEMES), (False, "white on black")]
)
def test_a_code_is_read_on_every_theme_and_without_colours_on_dark_ones(has_colours, theme):
    drawn = draw_qr(ADDRESS, Terminal(None, has_colours=has_colours, has_blocks=True))
    assert cv2.QRCodeDetector().detectAndDecode(shown(drawn, theme))[0] == ADDRESS


def test_a_sentence_says_why_there_is_no_code(monkeypatch):
    for terminal, said in (
        (Terminal(100, has_colours=True, has_blocks=False), "does not use UTF-8"),
        (Terminal(20, has_colours=True, has_blocks=True), "needs a window of 33 columns"),
    ):
        drawn = draw_qr(ADDRESS, terminal)
        assert said in drawn and "▀" not in drawn and drawn.count("\n") == 1
    monkeypatch.setitem(sys.modules, "segno", None)
    assert "drivelesson[lan]" in draw_qr("anything")


class Stream(io.StringIO):
    encoding = "utf-8"

    def isatty(self) -> bool:
        return True


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
def test_colours_are_used_where_the_terminal_has_them(environment, system, has_colours):
    terminal = Terminal.of(Stream(), environment, system)
    assert terminal == Terminal(None, has_colours=has_colours, has_blocks=True)
    file = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    assert Terminal.of(file, environment, system) == Terminal(None, False, False)
