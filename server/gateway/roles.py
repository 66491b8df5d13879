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
        may_change: The client may change things, not only read and stop the robot.
        may_drive: The client may drive the robot; only one client drives at a time.
        holds_stop: If the client stops the robot, only a client of this role can release STOP.
        paths: The only paths that the client may request besides public ones; None means all paths.
        start: The page to which the client is redirected from other paths.
        refusal: The sentence in the answer to a forbidden request.
        purpose: What this role may do, such as "drive"; empty if browsers cannot get the role.
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
    """The reason as a sentence for the person at the browser."""
    location: str | None = None
    """Address to which the browser is redirected; None for no redirection."""
    open_at: tuple[str, ...] = ()
    """Addresses of the page, for a client that used an unknown host name."""


@dataclass(frozen=True, slots=True)
class Session:
    """A client's role, and the name under which the limits count it."""

    role: Role
    name: str
    """The session's name for a browser that has proved who it is, or else the client's address."""
    is_crowd: bool = False
    """True if the name is only an address, which many people may share."""
