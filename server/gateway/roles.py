"""Roles of clients. An extension adds a role by an entry point of `drivelesson.roles`."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True, slots=True, kw_only=True)
class Role:
    """A client's permissions.

    Attributes:
        value: The role's name in messages and files.
        may_change: The client may do more than read, and more than stop the robot.
        may_drive: The client may have the wheel.
        holds_stop: Only this role can release a robot that this role has stopped.
        paths: The only paths that the client may request besides public ones; None means all paths.
        start: The page to which the client is redirected.
        refusal: The sentence in the answer to a forbidden request.
        purpose: The purpose of a browser with this role, worded to follow "may"; empty if no
            browser gets the role.
    """

    value: str
    may_change: bool = False
    may_drive: bool = False
    holds_stop: bool = False
    paths: re.Pattern[str] | None = None
    start: str | None = None
    refusal: str = "This browser may watch; only a pilot may change things."
    purpose: str = ""

    VIEWER: ClassVar[Role]
    PILOT: ClassVar[Role]


Role.VIEWER = Role(value="viewer", purpose="watch")
Role.PILOT = Role(value="pilot", may_change=True, may_drive=True, purpose="drive")


@dataclass(frozen=True, slots=True)
class Refusal:
    """The answer to a refused request."""

    status: int
    reason: str
    """Short name for logs and metrics."""
    sentence: str
    """Text for the person."""
    location: str | None = None
    """Address to redirect to."""
    open_at: tuple[str, ...] = ()
    """Addresses of the page, for a client that used an unknown name."""


@dataclass(frozen=True, slots=True)
class Session:
    """A client's role, and the name by which the client is counted."""

    role: Role
    name: str
    """The session's name for a browser that proved who it is, otherwise the client's address."""
    is_crowd: bool = False
    """True if the name is only an address, behind which many people may be."""
