"""Roles of clients. An extension adds a role by an entry point of `drivelesson.roles`."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True, slots=True, kw_only=True)
class Role:
    """A client's permissions.

    Attributes:
        value: Its name, in messages and files.
        may_change: It may do more than read, and more than stop the robot.
        may_drive: It may have the wheel.
        holds_stop: A robot that it stops is released by this role only.
        paths: The only paths it may request besides public ones; None for no such limit.
        start: The page that it is sent to.
        refusal: The sentence that answers a forbidden request.
        purpose: The purpose of a browser in it, after "to"; empty if no browser gets the role.
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
    """A client's role, and the name that it is counted by."""

    role: Role
    name: str
    """Of a browser that has proved who it is that of its session, and else the address."""
    is_crowd: bool = False
    """Many people may be behind it: it is only an address."""
