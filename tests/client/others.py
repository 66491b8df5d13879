"""The other clients of a robot: the phone that is its eye, the teacher's board, a command line."""

from __future__ import annotations

import asyncio
import contextlib
import io
import json
import random
from collections.abc import Coroutine
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np

from robot.errors import RobotError
from server.board.board import Board
from server.board.class_models import ClassModels, ClassOrder
from server.board.transport import RobotAddress
from server.bodies.eye import encode_frame
from server.cli.main import main
from tests.client.bodies import Pool
from tests.server.board.classroom_world import KEY, VirtualNetwork
from tests.server.virtual_server import VirtualServer

_T = TypeVar("_T")
EYE_RATE_HZ = 12.0
_AHEAD_MS = 5_000_000.0
"""How far the eye's clock is ahead of the robot's."""


def _pictures() -> list[bytes]:
    dice = np.random.default_rng(3)
    drawn = [dice.integers(0, 255, (24, 32, 3), np.uint8) for _ in range(8)]
    return [cv2.imencode(".jpg", picture)[1].tobytes() for picture in drawn]


PICTURES = _pictures()


class Eye:
    """A phone that is the robot's eye: it answers questions about its clock and sends pictures."""

    def __init__(self, server: VirtualServer, headers: dict[str, str]) -> None:
        self._server = server
        self.is_silent = self.is_covered = self.has_ended = False
        self._seq = 0

        async def begin() -> None:
            self.socket = server.connect("/ws/eye", self._hear, headers)
            self._later = asyncio.get_running_loop().call_later
            self._beat()

        server.run(begin())

    def stop(self) -> None:
        self._say(type="stop")

    def vanish(self) -> None:
        self.has_ended = True

        async def cut() -> None:
            self.socket.cut()

        self._server.run(cut())

    def _hear(self, message: str | bytes) -> None:
        if isinstance(message, str) and (words := json.loads(message))["type"] == "ping":
            self._say(type="pong", server_ms=words["server_ms"], eye_ms=self._now_ms())

    def _say(self, **words: Any) -> None:
        self.socket.send(json.dumps(words))

    def _now_ms(self) -> float:
        return self._server.clock.now_s() * 1000 + _AHEAD_MS

    def _beat(self) -> None:
        if self.has_ended or self.socket.is_closed:
            return
        if not self.is_silent:
            self._seq += 1
            picture = PICTURES[self._seq % len(PICTURES)]
            frame = encode_frame(self._seq, self._now_ms(), picture, is_covered=self.is_covered)
            self.socket.send(frame)
        self._later(1 / EYE_RATE_HZ, self._beat)


class Teacher:
    """The board of a class of one robot, over a network that can fail."""

    def __init__(self, server: VirtualServer, dice: random.Random) -> None:
        self._server, self._dice = server, dice

        async def begin() -> None:
            network = VirtualNetwork({server.port: server}, dice)
            self.board = Board(KEY, network, server.clock)
            self.board.add(RobotAddress("127.0.0.1", server.port))
            self.models = ClassModels(lambda: list(self.board.robots.values()), server.clock)

        server.run(begin())
        [self.link] = self.board.robots.values()
        self.shown = self.link.stop.id
        """The `stop_id` that the teacher has seen; it is old at times."""

    def stop(self) -> None:
        self._do(self.board.stop)

    def look(self) -> None:
        self.shown = self.link.stop.id

    def release(self) -> int | None:
        """Release what the teacher has seen; return the number that the robot is told, if any."""
        is_sent = self.link.stop.channel is not None and self.shown == self.link.stop.id
        number = self.link.stop.number if is_sent else None
        self._do(lambda: self.board.release({self.link.number: self.shown}))
        return number

    def rename(self, name: str) -> bool:
        """Rename the robot; return whether it did."""
        return self._ask(self.link.ask("PUT", "/api/settings", {"name": name}))

    def lock(self, locks: list[str]) -> bool:
        return self._ask(self.link.ask("PUT", "/api/class/locks", {"locks": locks}))

    def order(self) -> bool:
        """Have the robot save or reset its model; return whether it did all of it."""
        order = self._dice.choice([ClassOrder.KEEP, ClassOrder.RESET])
        told = self._server.run(self.models.give(order))
        return all(one["did"] == order.value for one in told["robots"])

    def close(self) -> None:
        self._server.run(self.board.close())

    def _ask(self, question: Coroutine[Any, Any, Any]) -> bool:
        try:
            answer = self._server.run(question)
        except RobotError:
            return False
        return answer.json().get("kept") is not False

    def _do(self, act: Any) -> None:
        async def run() -> None:
            act()

        self._server.run(run())


class Command:
    """One call of the command line beside the running server.

    Attributes:
        words: The words after `drivelesson`.
        changes: True if it changes episodes.
    """

    def __init__(self, dice: random.Random, pool: Pool, root: Path, kind: str = "") -> None:
        episode = dice.choice([*pool.episodes, "last", "nothing"])
        self._episode = episode
        kind = kind or dice.choice(
            [
                *("list", "show", "export", "budget"),
                *("title", "protect", "unprotect", "relabel", "trim", "undo", "compact"),
                *("delete", "delete", "restore", "zip"),
            ]
        )
        self.kind, self._title = kind, dice.choice(["a title", "another", "Ä"])
        self.changes = kind not in ("list", "show", "export", "budget")
        a_range = ["--from", str(dice.randrange(3)), "--to", str(3 + dice.randrange(3))]
        more = {
            "list": [],
            "budget": ["--gigabytes", "1"],
            "title": [episode, self._title],
            "relabel": [episode, *a_range, "--label", dice.choice(["left", "right"])],
            "trim": [episode, *a_range],
            "delete": [episode, *dice.choice([a_range, []])],
            "restore": [dice.choice([*pool.keys, "nothing"])],
            "zip": [episode, *dice.choice([["--delete"], []])],
            "export": [episode, "--as", dice.choice(["npz", "folder", "tub"])],
        }.get(kind, [episode])
        self.words = ["episodes", kind, *more, "--data", str(root)]
        self.is_whole = kind == "delete" and "--from" not in more

    def run(self) -> tuple[int, str]:
        """Return its exit status and its last words."""
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            try:
                status = main(self.words)
            except SystemExit as ended:
                status = int(ended.code or 0)
        return status, (err.getvalue() or out.getvalue())[-500:]

    def untrue(self, episodes: dict[str, Any]) -> str | None:
        """Return what is not as the command said; `episodes` are facts after its success."""
        found = episodes.get(self._episode)
        if self._episode in ("last", "nothing"):
            return None
        if self.is_whole and found is not None:
            return "deleted, and still there"
        if found is None:  # the recording that is being written is not among the facts
            return None
        title, is_protected = found[:2]
        if self.kind == "title" and title != self._title:
            return f"the title is {title!r}"
        if self.kind in ("protect", "unprotect") and is_protected is not (self.kind == "protect"):
            return f"protected is {is_protected}"
        return None
