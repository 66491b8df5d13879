"""The robot's name and its colour, saved in the data folder."""

from __future__ import annotations

import json
import logging
import secrets
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from robot.errors import UNREADABLE, ConfigurationError
from robot.store.folder import check_name, write_whole
from robot.store.records import read_regular

log = logging.getLogger(__name__)

_NAMES = (
    "Ada Bolt Comet Dot Echo Fox Gizmo Hazel Indigo Juno Kiwi Luna Milo Nova Otto Pixel Quill"
    " Rover Scout Tango Umi Vega Wren Yuki Ziggy"
)
NAMES = tuple(_NAMES.split())
"""At its first start, a robot that was given no name gets one of these."""
COLOURS = ("grey", "green", "purple", "pink", "brown", "teal")
"""Colours of robots. The page uses amber, blue and red for the pilot, the robot and STOP."""
LONGEST_NAME = 24


@dataclass(frozen=True, slots=True)
class Identity:
    """One robot's name and colour."""

    name: str
    colour: str = COLOURS[0]

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise ConfigurationError("a robot's name must be text")
        check_name(self.name)  # a robot's name is also the name of its models
        if len(self.name) > LONGEST_NAME:
            raise ConfigurationError(f"a robot's name may have at most {LONGEST_NAME} characters")
        if self.colour not in COLOURS:
            raise ConfigurationError(f"a robot's colour must be one of {', '.join(COLOURS)}")


class IdentityFile:
    """Saves the identity of a robot in `robot.json`; without a folder, nothing is saved."""

    def __init__(self, folder: Path | None, name: str | None = None) -> None:
        self._path = folder / "robot.json" if folder is not None else None
        saved = self._read()
        if name is not None:
            self.now = Identity(name.strip(), saved.colour if saved else COLOURS[0])
        else:
            self.now = saved or Identity(secrets.choice(NAMES))
        if self.now != saved:
            try:
                self._write(self.now)
            except OSError as error:  # the robot can start although its name is not saved
                log.warning("the robot's name was not saved: %s", error)

    def change(self, **fields: Any) -> Identity:
        """Change name or colour."""
        changed = replace(self.now, **fields)
        self._write(changed)
        self.now = changed
        return changed

    def _read(self) -> Identity | None:
        """Read the saved identity; a damaged file counts as missing."""
        if self._path is None:
            return None
        try:
            plain = json.loads(read_regular(self._path, 1 << 16))
            return Identity(plain["name"], plain["colour"])
        except (OSError, *UNREADABLE):
            return None

    def _write(self, identity: Identity) -> None:
        if self._path is not None:
            write_whole(self._path, json.dumps(asdict(identity)).encode())
