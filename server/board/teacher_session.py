"""The teacher's session with one robot: the handshake that opens it, and requests within it."""

from __future__ import annotations

import json
from collections.abc import Mapping
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
)

_LONGEST = 300
"""Letters that are read of a robot's sentence, number or proof."""


class Status(StrEnum):
    """What the board knows of a robot's server."""

    CONNECTING = "connecting"
    THERE = "there"
    AWAY = "away"
    NOT_OURS = "not_ours"
    NO_CLASS = "no_class"


class RefusedError(RobotError):
    """A robot answered that it will not."""

    def __init__(self, status: int, sentence: str) -> None:
        super().__init__(sentence)
        self.status = status


class WrongClassError(RobotError):
    """A robot is in no class, or in another."""

    def __init__(self, status: Status, sentence: str) -> None:
        super().__init__(sentence)
        self.status = status


class TeacherSession:
    """Asks one robot's server, as its teacher once `join` has succeeded.

    Args:
        address: Where the server is.
        key: The class's key.
        transport: Reaches it.
    """

    def __init__(self, address: RobotAddress, key: ClassKey, transport: NetworkTransport) -> None:
        self.address, self._key, self._transport = address, key, transport
        self.place: ServerPlace | None = None
        self._secret: str | None = None

    @property
    def is_open(self) -> bool:
        """True while the robot is believed to know this session."""
        return self._secret is not None and self.place is not None

    @property
    def headers(self) -> dict[str, str]:
        """What every request within the session carries."""
        return {"authorization": f"Bearer {self._secret}"} if self._secret else {}

    async def join(self) -> ServerPlace:
        """Prove to each other that board and robot are of one class; open a session.

        Raises:
            WrongClassError: If they are not.
            UnreachableError: If the robot does not answer.
        """
        place = self.place = await self._transport.locate(self.address)
        nonce = new_nonce()
        answer = await self._post(place, "/api/class/hello", {"nonce": nonce})
        if answer.status in (401, 404):
            raise WrongClassError(
                Status.NO_CLASS, "it is in no class: start it with --class-key FILE"
            )
        if answer.status != 200:
            raise UnreachableError(_sentence(answer))
        offer = answer.json()
        robot_nonce, proof = (str(offer.get(name, ""))[:_LONGEST] for name in ("nonce", "proof"))
        if not self._key.accepts(proof, "robot", nonce, robot_nonce, place.endpoint):
            raise WrongClassError(Status.NOT_OURS, "it has another class key")
        own = self._key.prove("board", nonce, robot_nonce, place.endpoint)
        words = {"board_nonce": nonce, "nonce": robot_nonce, "proof": own}
        answer = await self._post(place, "/api/class/join", words)
        secret = answer.json().get("secret")
        if answer.status != 200 or not isinstance(secret, str):
            raise WrongClassError(Status.NOT_OURS, "it does not admit this board")
        self._secret = secret
        return place

    async def ask(self, method: str, path: str, body: Any = None) -> HttpAnswer:
        """Send a request as the teacher; a session that the robot has forgotten is closed.

        Args:
            method: Such as `PUT`.
            path: The robot's address, below its server.
            body: Sent as JSON, or as it is if it is bytes.

        Raises:
            RefusedError: If the robot refuses; with its own sentence.
            UnreachableError: If it does not answer.
        """
        if self.place is None or self._secret is None:
            raise UnreachableError("it is not connected")
        headers, data = self.headers, b""
        if isinstance(body, bytes):
            headers["content-type"], data = "application/octet-stream", body
        elif body is not None:
            headers["content-type"], data = "application/json", json.dumps(body).encode()
        answer = await self._transport.request(self.place, method, path, headers, data)
        if answer.status >= 400:
            if answer.status == 401:
                self._secret = None  # it was started anew
            raise RefusedError(answer.status, _sentence(answer))
        return answer

    def forget(self) -> None:
        """Close the session; `join` opens the next."""
        self._secret = None

    async def _post(self, place: ServerPlace, path: str, words: Mapping[str, str]) -> HttpAnswer:
        headers = {"content-type": "application/json"}
        return await self._transport.request(
            place, "POST", path, headers, json.dumps(words).encode()
        )


def _sentence(answer: HttpAnswer) -> str:
    return str(answer.json().get("detail") or f"it answered {answer.status}")[:_LONGEST]
