"""Gives an order from the command line to the board that runs on this computer."""

from __future__ import annotations

import json
from typing import Any
from urllib.error import HTTPError, URLError
from urllib.request import Request, urlopen

from robot.errors import ConfigurationError, NotConnectedError
from server.board.class_command import PORT
from server.board.class_models import PATIENCE_S

_ANSWERED_S = PATIENCE_S + 10.0
"""How long the board may take to answer, in seconds; it waits for the slowest robot."""
_DID = {
    "keep": "kept a copy: {model}",
    "reset": "starts over",
    "hand_over": "is ready for the next class",
    "empty": "has learned nothing yet, so there is nothing to keep",
    "undone": "is as it was before the order",
    "away": "did not answer: {detail}",
    "failed": "could not do it: {detail}",
}
_SAVED = {"reset": "; saved before: {model}", "hand_over": "; saved before: {model}"}
"""Text at the end of a robot's line of output if the robot saved its model first."""
_FAILED = ("away", "failed")


def give_order(order: str, port: int) -> tuple[bool, list[str]]:
    """Have the board at this port give an order to all robots.

    Returns:
        True if every robot has carried out the order, and a line for each robot; the lines of
        robots that failed come first.

    Raises:
        NotConnectedError: If no board answers at this port.
        ConfigurationError: If the board refuses the order.
    """
    answer = _ask(order, f"http://127.0.0.1:{port}")
    robots = answer["robots"]
    undo = "drivelesson class undo" + (f" --port {port}" if port != PORT else "")
    failed = [one for one in robots if one["did"] in _FAILED]
    lines = []
    for one in [*failed, *(one for one in robots if one not in failed)]:
        more = _SAVED.get(one["did"], "") if one["model"] else ""
        said = (_DID[one["did"]] + more).format_map(one).removesuffix(": ")
        name = one["name"] or f"robot {one['number']}"
        lines.append(f"{name}: {said}")
    if not robots:
        lines.append("the board has no robots")
    elif order == "undo" and failed:
        lines.append(f"To undo it on these robots, too: {undo}")
    elif order != "undo" and any(one["did"] == order.replace("-", "_") for one in robots):
        lines.append(f"To undo it: {undo}")
    return bool(robots) and not failed, lines


def _ask(order: str, board: str) -> dict[str, Any]:
    path = "/api/models/undo" if order == "undo" else "/api/models"
    body = {} if order == "undo" else {"order": order.replace("-", "_")}
    headers = {"Content-Type": "application/json"}
    try:
        request = Request(board + path, json.dumps(body).encode(), headers, method="POST")
        with urlopen(request, timeout=_ANSWERED_S) as answer:
            found: dict[str, Any] = json.load(answer)
            return {"robots": found["robots"]}
    except HTTPError as error:
        with error:
            detail = error.read().decode("utf-8", "replace")
        if error.code == 404 and "undo" in detail:
            raise ConfigurationError("there is no order that can be undone") from None
        raise ConfigurationError(
            f"{board} is not a board, or refused the order (status {error.code}): give the board's "
            "port with --port"
        ) from None
    except (URLError, OSError, ValueError, KeyError, TypeError):
        raise NotConnectedError(
            f"no board answers at {board}: start it with `drivelesson class` or `drivelesson "
            "board`, or give its port with --port"
        ) from None
