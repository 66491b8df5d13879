"""Opens the page if the robot is started on a computer with a screen."""

from __future__ import annotations

import os
import sys
import threading
import webbrowser
from collections.abc import Mapping


def has_screen(system: str, environment: Mapping[str, str]) -> bool:
    """True if a browser can open a window.

    A text browser does not count, because it would take over the terminal.
    """
    if "SSH_CONNECTION" in environment:  # the person uses another machine
        return False
    has_display = bool(environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY"))
    return system in ("win32", "darwin") or has_display


def show_page(address: str) -> None:
    """Open the address in the browser without waiting for it."""
    if has_screen(sys.platform, os.environ):
        threading.Thread(target=webbrowser.open, args=[address], daemon=True).start()
