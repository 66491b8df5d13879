"""Draws QR codes on a terminal so that a phone's camera can read them with every colour theme.

Many readers need dark modules on a light ground. Characters without a colour get the theme's
colours, which may invert the code. A terminal with colours therefore gets the fixed black and white
of the 256-colour palette, which themes do not change.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import zip_longest
from typing import TextIO

from robot.errors import install_command

_COLOURS, _RESET = "\x1b[38;5;16;48;5;231m", "\x1b[0m"
_BLOCKS = {(0, 0): " ", (1, 0): "▀", (0, 1): "▄", (1, 1): "█"}
"""The character that shows two modules of a QR code, (upper, lower); 1 is dark."""
_INVERSE = {pair: _BLOCKS[1 - pair[0], 1 - pair[1]] for pair in _BLOCKS}


@dataclass(frozen=True, slots=True)
class Terminal:
    """The capabilities of the terminal on which a code is printed.

    Attributes:
        columns: The width in characters; None if the text goes to a file or another program.
        has_colours: True if the terminal shows the 256 colours.
        has_blocks: True if the terminal's encoding has the half-block characters.
    """

    columns: int | None
    has_colours: bool
    has_blocks: bool

    @classmethod
    def of(cls, stream: TextIO, environment: Mapping[str, str], system: str) -> Terminal:
        """Return the capabilities of a stream; `system` is `sys.platform`."""
        try:
            "▀▄█".encode(stream.encoding or "ascii")
            has_blocks = True
        except (UnicodeEncodeError, LookupError):
            has_blocks = False
        if not stream.isatty():
            return cls(None, has_colours=False, has_blocks=has_blocks)
        try:
            columns = os.get_terminal_size(stream.fileno()).columns or None
        except (OSError, ValueError):
            columns = None
        knows_colours = environment.get("TERM", "" if system == "win32" else "dumb") != "dumb"
        if system == "win32":  # the old Windows console prints escape sequences as text
            knows_colours = any(name in environment for name in ("WT_SESSION", "TERM", "ANSICON"))
        has_colours = knows_colours and not environment.get("NO_COLOR")
        return cls(columns, has_colours=has_colours, has_blocks=has_blocks)


def draw_qr(text: str, terminal: Terminal | None = None) -> str:
    """Return the lines that draw a text as a QR code, each with a line end.

    If the code cannot be drawn, a sentence with the reason is returned instead.

    Args:
        text: The code's content, for example an address.
        terminal: The terminal that shows the code; by default standard output.
    """
    terminal = terminal or Terminal.of(sys.stdout, os.environ, sys.platform)
    try:
        import segno
    except ImportError:
        return f"(a QR code needs drivelesson[lan]: {install_command('lan')})\n"
    if not terminal.has_blocks:
        return "(no QR code: this terminal does not use UTF-8; use the address)\n"
    # A border of two light modules is enough for readers; the standard asks for four.
    rows = [list(row) for row in segno.make(text, error="l", micro=False).matrix_iter(border=2)]
    width = len(rows[0])
    if terminal.columns is not None and terminal.columns < width:
        return f"(no QR code: it needs a window of {width} columns; use the address)\n"
    blocks = _BLOCKS if terminal.has_colours else _INVERSE
    before, after = (_COLOURS, _RESET) if terminal.has_colours else ("", "")
    drawn = ""
    for upper, lower in zip_longest(rows[::2], rows[1::2], fillvalue=[0] * width):
        line = "".join(blocks[pair] for pair in zip(upper, lower, strict=True))
        drawn += f"{before}{line}{after}\n"
    if terminal.columns is not None and not terminal.has_colours:
        drawn += "(if your phone cannot read this, use a dark window or the address)\n"
    return drawn
