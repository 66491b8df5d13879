"""Who may come in: Host, Origin and role of a request. Pure.

On loopback everybody on this machine is let in as a pilot, but Host and Origin are checked even
there: a page of another site, open in the same browser, must not reach the robot by cross-site
websockets or by DNS rebinding.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from enum import StrEnum
from urllib.parse import urlsplit


class Role(StrEnum):
    """What a browser may become."""

    VIEWER = "viewer"
    PILOT = "pilot"


@dataclass(frozen=True, slots=True, kw_only=True)
class Refusal:
    """An answer in place of what was asked for."""

    status: int
    reason: str
    """A word for logs and metrics."""
    sentence: str
    """For the person."""


def check_host(headers: Mapping[str, str], names: Collection[str]) -> Refusal | None:
    """Refuse a request that was addressed to another name: DNS rebinding."""
    name = host_name(headers.get("host", ""))
    if name in names:
        return None
    return Refusal(
        status=421,
        reason="host",
        sentence=f"This robot does not answer to that name. It answers to: {', '.join(names)}",
    )


def check_origin(headers: Mapping[str, str], scheme: str) -> Refusal | None:
    """Refuse what a page of another site has sent. Programs send no Origin, browsers cannot lie."""
    origin = headers.get("origin")
    site = headers.get("sec-fetch-site", "none")
    if origin is None and site in ("none", "same-origin"):
        return None
    if origin is not None and origin == f"{scheme}://{headers.get('host', '')}":
        return None
    if origin is None and headers.get("sec-fetch-mode") == "navigate":
        return None  # a person followed a link; the page itself is no secret and may not be framed
    return Refusal(
        status=403, reason="origin", sentence="This was asked by a page of another site."
    )


def host_name(host: str) -> str:
    """Return the name in a Host header: without port, in lower case; empty if it is none."""
    try:
        return (urlsplit(f"//{host}").hostname or "").rstrip(".")
    except ValueError:
        return ""
