"""The messages between Drivelesson and a robot of any kind: orders and reports. Pure.

The module also parses a robot's address and moves, as a person gives them on the command line.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from robot.devices.options import option
from robot.driver import Sensors
from robot.errors import ConfigurationError
from robot.moves import CLASSIC, Move
from robot.types import Action, Point

MAX_BYTES = 512
_LONGEST_ID = 64
_NO_NUMBER = re.compile(rb'("(?:[^"\\]|\\.)*")|[-+]?\b(?:inf(?:inity)?|nan|ovf)\b', re.I)
"""Words that small computers write for a missing number, although JSON does not allow them: `inf`
and `nan` from MicroPython's json, and `ovf` from Arduino's print."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyReport:
    """A robot's report: the last order that it obeyed, and the values of its sensors.

    `nonce` is a random text, new at each start of the robot. The nonce is empty on private
    connections, whose orders need no signature. `seq` is the number of the last obeyed order, and
    `ms` the time on the robot's clock. `takes_points` is true if the robot accepts orders with
    steering and throttle. `device` is a unique name of the robot, or empty.
    """

    nonce: str = ""
    seq: int
    ms: int
    sensors: Sensors
    takes_points: bool = False
    device: str = ""


@dataclass(frozen=True, slots=True)
class Order:
    """One order to a body: a move, with its duration and its share of full speed.

    `seq` is the number of the order. `seen_ms` is the time in the newest report from the body, by
    the body's clock.
    """

    move: Action
    for_ms: int
    speed: float
    seq: int
    seen_ms: int
    point: Point | None = None


def encode_order(order: Order, nonce: str, secret: str) -> bytes:
    """Encode and sign one order. By the order's number, the robot recognises a repetition. The
    robot has a new nonce after each start, so it refuses orders from before the start."""
    plain = asdict(order) | {"speed": round(order.speed, 4)}
    if (point := plain.pop("point")) is not None:
        plain |= {"steering": round(point.steering, 4), "throttle": round(point.throttle, 4)}
    text = json.dumps(plain, separators=(",", ":")).encode()
    mac = hmac.new(secret.encode(), nonce.encode() + text, hashlib.sha256)
    return text + b"\t" + mac.hexdigest()[:16].encode()


def parse_report(data: bytes) -> BodyReport | None:
    try:
        plain = json.loads(_NO_NUMBER.sub(lambda found: found[1] or b"null", data[:MAX_BYTES]))
        nonce, seq, ms = plain["nonce"], plain["seq"], plain["ms"]
        if not isinstance(nonce, str) or not _is_count(seq) or not _is_count(ms):
            return None
        points = plain.get("points") is True
        name = plain.get("id")
        return BodyReport(
            nonce=nonce,
            seq=seq,
            ms=ms,
            sensors=_sensors(plain),
            takes_points=points,
            device=name[:_LONGEST_ID] if isinstance(name, str) else "",
        )
    except (ValueError, KeyError, TypeError, RecursionError):
        return None


def _is_count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**53


def _sensors(plain: Mapping[str, Any]) -> Sensors:
    distance_m, bumped, battery = (plain.get(n) for n in ("distance_m", "bumped", "battery"))
    return Sensors(
        distance_m=_between(distance_m, 10.0),
        bumped=bumped if isinstance(bumped, bool) else None,
        battery_share=_between(battery, 1.0),
    )


def _between(value: Any, most: float) -> float | None:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number and 0 <= value <= most else None


def moves_option(default: str) -> Any:
    return option(default, "the body's moves: NAME or NAME:STEERING:THROTTLE, as in left,fast:0:1")


def parse_moves(text: str) -> tuple[Move, ...]:
    """Parse a list of a body's moves: `forward,left,fast:0:1`.

    Each move is a name, optionally followed by its steering and throttle.

    Raises:
        ConfigurationError: If an entry is not a move; the error names the entry.
    """
    moves = []
    for part in text.split(","):
        name, *numbers = part.strip().split(":")
        try:
            action, label = Action(name), name.replace("_", " ")
            steering, throttle = map(float, numbers) if numbers else (None, None)
            move = Move(action, label, steering=steering, throttle=throttle)
            moves.append(move if numbers else CLASSIC.get(action, move))
        except ValueError as error:
            raise ConfigurationError(
                f"--body-moves: {part.strip()!r} is not a move ({error}); write moves as in "
                "forward,left,fast:0:1"
            ) from error
    if len({move.name for move in moves}) != len(moves):
        raise ConfigurationError("--body-moves contains the same move twice; remove one of them")
    return tuple(moves)


def split_address(address: str, default_port: int, flag: str = "--address") -> tuple[str, int]:
    """Return host and port of HOST or HOST:PORT; raises ConfigurationError for any other text."""
    host, _, port = address.strip().rpartition(":") if ":" in address else (address.strip(), "", "")
    number = port or str(default_port)
    if not host or "/" in host or not number.isdecimal() or not 0 < int(number) < 65536:
        raise ConfigurationError(f"{flag} must be the robot's HOST or HOST:PORT, not {address!r}")
    return host, int(number)
