"""The corrections of the robot's body and camera, saved in the data folder."""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from robot.adjustments.corrections import Corrections, possible_corrections
from robot.devices.options import options_of
from robot.devices.rig import Rig
from robot.errors import UNREADABLE, ConfigurationError
from robot.store.folder import write_whole
from robot.store.records import read_regular
from server.adjustments.options import CorrectionOptions

log = logging.getLogger(__name__)

_PATIENCE_S = 40.0
"""Time limit for applying corrections, in seconds. Corrections are slow on a Raspberry Pi, where
the driver may claim its pins again."""


class CorrectionsFile:
    """Saves the corrections of each body and each camera in `corrections.json`.

    Args:
        folder: The folder of the file; None to save nothing.
        rig: The robot that is corrected.
        given: The corrections on the command line, which override saved ones.
    """

    def __init__(self, folder: Path | None, rig: Rig, given: Mapping[str, Any]) -> None:
        self._path = folder / "corrections.json" if folder is not None else None
        self._rig = rig
        self._saved = self._read()
        self._given = {
            one.name: one.read(given[one.name])
            for one in options_of(CorrectionOptions)
            if given.get(one.name) is not None
        }
        self._wanted = self._of_this_robot().changed(**self._given)

    @property
    def possible(self) -> tuple[str, ...]:
        """The names of the corrections that this body and this camera support."""
        of_camera = ("turn_picture", "mirror_picture") if self._rig.camera.can_be_turned else ()
        return (*possible_corrections(self._rig.driver), *of_camera)

    def apply(self) -> None:
        """Apply the saved and the given corrections to the running robot; save the given ones.

        Raises:
            ConfigurationError: If neither body nor camera supports a given correction.
        """
        names = {*self.possible, *self._given}
        wanted = {n: value for n, value in self._wanted.described().items() if n in names}
        corrections = Corrections().changed(**wanted)
        if corrections != Corrections.of(self._rig):
            done = self._rig.loop.submit(lambda: corrections.apply(self._rig))
            self._rig.clock.result(done, _PATIENCE_S)
        if self._given:
            try:
                self.save()
            except OSError as error:  # the robot can start although nothing is saved
                log.warning("the corrections were not saved: %s", error)

    def save(self) -> bool:
        """Save the robot's corrections; return False if there is no folder to save them in.

        Raises:
            OSError: If the file cannot be written.
        """
        if self._path is None:
            return False
        plain = Corrections.of(self._rig).described()
        of_camera = {name: plain.pop(name) for name in ("turn_picture", "mirror_picture")}
        for kind, name, values in (
            ("robots", self._rig.driver.name, plain),
            ("cameras", self._rig.camera.name, of_camera),
        ):
            self._saved[kind] = {**_table(self._saved.get(kind)), name: values}
        write_whole(self._path, json.dumps(self._saved, indent=1).encode())
        return True

    def _of_this_robot(self) -> Corrections:
        """Return the corrections saved for this body and camera; a damaged file counts as empty."""
        found: dict[str, Any] = {}
        for kind, name in (("robots", self._rig.driver.name), ("cameras", self._rig.camera.name)):
            found |= _table(_table(self._saved.get(kind)).get(name))
        known = {one.name: one for one in options_of(CorrectionOptions)}
        try:
            read = {name: known[name].read(value) for name, value in found.items() if name in known}
            return Corrections().changed(**read)
        except (ConfigurationError, *UNREADABLE):
            return Corrections()

    def _read(self) -> dict[str, Any]:
        if self._path is None:
            return {}
        try:
            plain = json.loads(read_regular(self._path, 1 << 16))
        except (OSError, *UNREADABLE):
            return {}
        return _table(plain)


def _table(plain: Any) -> dict[str, Any]:
    return plain if isinstance(plain, dict) else {}
