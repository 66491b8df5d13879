"""What a person is shown when the robot is ready: addresses, QR codes for phones, or the page."""

from __future__ import annotations

import os
import sys
import threading
import webbrowser
from collections.abc import Mapping, Sequence

from server.access.rules import Role
from server.hosting.terminal_code import draw_qr


def greet_here(address: str, *, with_eye: bool = False) -> str:
    eye = f"The robot's eye: open {address}/eye\n" if with_eye else ""
    return f"Drivelesson is ready: open {address}\n{eye}"


def greet_phones(addresses: Sequence[str], tokens: dict[Role, str]) -> str:
    """Return the addresses on the network, and how a phone pairs."""
    lines = ["Drivelesson is ready. Only paired browsers are admitted.", ""]
    pilot = pairing_address(addresses[0], tokens[Role.PILOT])
    lines += ["To drive, scan this with the phone:", "", *draw_qr(pilot).splitlines(), ""]
    lines += [f"  or open   {pilot}"]
    lines += [f"  at one of {' '.join(addresses)}"] if len(addresses) > 1 else []
    lines += [f"  To watch: {pairing_address(addresses[0], tokens[Role.VIEWER])}", ""]
    if Role.EYE in tokens:
        eye = pairing_address(addresses[0], tokens[Role.EYE])
        lines += ["The phone on the robot, its eye, scans this:", "", *draw_qr(eye).splitlines()]
        lines += ["", f"  or opens  {eye}", ""]
    lines += ["Each address works once; then a new one is shown."]
    return "\n".join(lines) + "\n"


def greet_next(address: str, role: Role, token: str) -> str:
    """Return how the next browser pairs: a pilot by a code, as the first one did."""
    verb = {Role.PILOT: "drive", Role.VIEWER: "watch", Role.EYE: "be the robot's eye"}[role]
    there = pairing_address(address, token)
    code = "\n" + draw_qr(there) if role is Role.PILOT else ""
    return f"A browser was paired. The next one that is to {verb}: {there}{code}"


def pairing_address(address: str, token: str) -> str:
    """Return the address that pairs; the part after the `#` stays in the browser."""
    return f"{address}/pair#{token}"


def has_screen(system: str, environment: Mapping[str, str]) -> bool:
    """True where a browser has a window: elsewhere one of text would take the terminal."""
    if "SSH_CONNECTION" in environment:  # the screen is another machine's
        return False
    has_display = bool(environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY"))
    return system in ("win32", "darwin") or has_display


def show_page(address: str) -> None:
    """Open the address in the browser, which nobody waits for."""
    if has_screen(sys.platform, os.environ):
        threading.Thread(target=webbrowser.open, args=[address], daemon=True).start()
