"""The teacher's session with one robot: the handshake that opens it, and requests within it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import AbstractAsyncContextManager
from enum import StrEnum
from typing import Any

from robot.errors import RobotError
from server.board.class_key import ClassKey, new_nonce
from server.board.transport import (
    HttpAnswer,
    NetworkTransport,
    RobotAddress,
    ServerPlace,
    UnreachableError,
    within,
)

_LONGEST = 300
"""Maximum length of an error message, nonce or proof from a robot, in characters; the rest is
ignored."""


class Status(StrEnum):
    """The state of a robot's server as known to the board."""

    CONNECTING = "connecting"
    THERE = "there"
    AWAY = "away"
    NOT_OURS = "not_ours"
    NO_CLASS = "no_class"


class RefusedError(RobotError):
    """A robot refused a request."""

    def __init__(self, status: int, sentence: str) -> None:
        super().__init__(sentence)
        self.status = status


class WrongClassError(RobotError):
    """A robot belongs to no class or to another class."""

    def __init__(self, status: Status, sentence: str) -> None:
        super().__init__(sentence)
        self.status = status


class TeacherSession:
    """Sends requests to one robot's server. After `join`, the requests have the rights of the
    teacher.

    Methods that send a request raise UnreachableError if the robot does not answer.
    """

    def __init__(self, address: RobotAddress, key: ClassKey, transport: NetworkTransport) -> None:
        self.address, self.key, self._transport = address, key, transport
        self.place: ServerPlace | None = None
        self._secret: str | None = None
        self._is_doubted = False

    @property
    def is_open(self) -> bool:
        """True while the robot is believed to know this session."""
        return self._secret is not None and not self._is_doubted

    async def join(self) -> None:
        """Open a session with the robot. Before this, board and robot prove to each other that they
        have the same class key.

        If an earlier session is only in doubt, a STOP still uses it until the new one is open.

        Raises:
            WrongClassError: If board and robot are of different classes.
        """
        place = await self._transport.locate(self.address)
        if self._secret is None:
            self.place = place
        nonce = new_nonce()
        answer = await self._send_to(place, {}, "POST", "/api/class/hello", {"nonce": nonce})
        if answer.status in (401, 404):
            raise WrongClassError(
                Status.NO_CLASS, "the robot is in no class: start it with --class-key FILE"
            )
        if answer.status != 200:
            raise UnreachableError(_sentence(answer))
        offer = answer.json()
        robot_nonce, proof = (str(offer.get(name, ""))[:_LONGEST] for name in ("nonce", "proof"))
        if not self.key.accepts(proof, "robot", nonce, robot_nonce, place.endpoint):
            raise WrongClassError(Status.NOT_OURS, "the robot has the key of another class")
        own = self.key.prove("board", nonce, robot_nonce, place.endpoint)
        words = {"board_nonce": nonce, "nonce": robot_nonce, "proof": own}
        answer = await self._send_to(place, {}, "POST", "/api/class/join", words)
        secret = answer.json().get("secret")
        if answer.status != 200 or not isinstance(secret, str):
            raise WrongClassError(
                Status.NOT_OURS, "the robot does not accept this board's proof of the class key"
            )
        self.place, self._secret, self._is_doubted = place, secret, False

    async def ask(self, method: str, path: str, body: Any = None) -> HttpAnswer:
        """Send a request as the teacher; close the session if the robot has forgotten it.

        Raises:
            RefusedError: If the robot refuses the request. The message comes from the robot.
        """
        if not self.is_open:
            raise UnreachableError("the robot is not connected")
        answer = await self.send(method, path, body)
        if answer.status >= 400:
            if answer.status == 401:
                self._secret = None  # the robot restarted
            raise RefusedError(answer.status, _sentence(answer))
        return answer

    async def send(self, method: str, path: str, body: Any = None) -> HttpAnswer:
        """Send a request and return the answer; before `join` the answer may be forged.

        A body of bytes is sent unchanged, any other as JSON.
        """
        return await self._send_to(self._there, self.headers, method, path, body)

    async def _send_to(
        self, place: ServerPlace, own: Mapping[str, str], method: str, path: str, body: Any
    ) -> HttpAnswer:
        is_file = isinstance(body, bytes)
        data = body if is_file else b"" if body is None else json.dumps(body).encode()
        kind = "application/octet-stream" if is_file else "application/json"
        headers = {**own, "content-type": kind}
        async with within(None):
            return await self._transport.request(place, method, path, headers, data)

    def connect(self, path: str) -> AbstractAsyncContextManager[Any]:
        return self._transport.connect(self._there, path, self.headers)

    def forget(self) -> None:
        """Close the session; `join` opens a new one."""
        self._secret = None

    def doubt(self) -> None:
        """Open a new session before the next request of `ask`: the robot may have another address
        or certificate."""
        self._is_doubted = True

    @property
    def _there(self) -> ServerPlace:
        if self.place is None:
            raise UnreachableError("the robot is not connected")
        return self.place

    @property
    def headers(self) -> dict[str, str]:
        return {"authorization": f"Bearer {self._secret}"} if self._secret else {}


def _sentence(answer: HttpAnswer) -> str:
    return str(answer.json().get("detail") or f"the robot answered {answer.status}")[:_LONGEST]
