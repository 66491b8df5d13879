"""A robot's side of a class, as a part of its server."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from server.board import robot_routes
from server.board.class_key import read_class_key
from server.board.classroom import Classroom
from server.extension import Extension

if TYPE_CHECKING:
    from server.services import Services


class ClassroomExtension(Extension):
    """The class that the robot belongs to, if any: `classroom` is None for a robot in no class.

    The option `class_key` names the key's file; `classroom` instead gives a class that is open.
    """

    routers = (robot_routes.router,)

    def __init__(self, services: Services, options: Mapping[str, Any]) -> None:
        file: Path | None = options.get("class_key")
        self.classroom: Classroom | None = options.get("classroom")
        if file is not None:
            self.classroom = Classroom(read_class_key(file), services.config.data / "class.json")
        if self.classroom is not None and services.pairing is not None:
            services.pairing.class_code = self.classroom.code
        self.members = self.classroom

    @classmethod
    def configure(cls, parser: argparse.ArgumentParser) -> None:
        """Declare the option for the class's key."""
        parser.add_argument(
            "--class-key",
            type=Path,
            default=None,
            metavar="FILE",
            help="obey the board that has this key; drivelesson board makes it",
        )
