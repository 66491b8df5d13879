"""The text for the terminal: the server's addresses, and QR codes for phones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from server.access.terminal_code import draw_qr
from server.gateway.roles import Role


def greet_phones(addresses: Sequence[str], tokens: Mapping[Role, str], more: Sequence[str]) -> str:
    """Return the banner: how to pair a phone at `addresses`, then the lines of `more`."""
    lines = ["Drivelesson is ready. Only paired browsers are admitted.", ""]
    pilot = pairing_address(addresses[0], tokens[Role.PILOT])
    lines += ["To drive, scan this with the phone:", "", *draw_qr(pilot).splitlines(), ""]
    lines += [f"  or open   {pilot}"]
    lines += [f"  at one of {' '.join(addresses)}"] if len(addresses) > 1 else []
    lines += [f"  To watch: {pairing_address(addresses[0], tokens[Role.VIEWER])}", "", *more]
    lines += ["Each address can be used once; then a new one is shown."]
    return "\n".join(lines) + "\n"


def greet_next(address: str, role: Role, token: str) -> str:
    """Return the text that says how to pair the next browser; for a pilot, it has a QR code."""
    there = pairing_address(address, token)
    code = "\n" + draw_qr(there) if role is Role.PILOT else ""
    return f"A browser was paired. To pair another one that may {role.purpose}: {there}{code}"


def pairing_address(address: str, token: str) -> str:
    """Return the pairing address. The token follows the `#`; browsers never send that part."""
    return f"{address}/pair#{token}"
