"""The line to a brick that stands elsewhere: the other end of `robot.brick.agent`.

One thread owns the connection: it joins, listens, pings five times a second, and joins again when
the line was lost. Commands go out on the caller's thread and never wait for an answer.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robot.brick.agent import (
    ENCODINGS,
    PICTURE,
    PORT,
    PROTOCOL,
    HardwareError,
    Unpacker,
    pack_json,
    prove,
)
from robot.errors import ConfigurationError

PATIENCE_S = 3.0
"""How long joining, or opening the body, may take."""
SILENCE_S = 0.5
"""A brick that says nothing for so long does not answer; it speaks ten times a second."""
PING_S = 0.2
REJOIN_S = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """One frame from the brick; `taken_s` is on this machine's monotonic clock."""

    data: bytes
    taken_s: float
    width: int
    height: int
    encoding: str


class BrickLink:
    """A connection to one brick's agent, shared by its driver and its camera."""

    def __init__(self, address: str, secret: str = "") -> None:
        self._address = address
        self._secret = secret
        self._users: set[str] = set()
        self._line: socket.socket | None = None
        self._sending = threading.Lock()
        self._ending = threading.Event()
        self._thread: threading.Thread | None = None
        self._answers: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        self._wishes: dict[str, dict[str, Any]] = {}
        self._unpacker = Unpacker()
        self._heard_s = 0.0
        self._offset_s: float | None = None
        self._lost: str | None = None
        self._told: dict[str, Any] = {}
        self._buttons: list[str] = []
        self.on_picture: Callable[[Picture], None] | None = None

    @property
    def fault(self) -> str | None:
        """What is wrong with the line, as a sentence; None if the brick answers."""
        if self._lost is not None:
            return f"the line to the brick at {self._address} is lost ({self._lost}); trying again"
        if time.monotonic() - self._heard_s > SILENCE_S:
            return f"the brick at {self._address} does not answer; is it on, and in the network?"
        return None

    @property
    def camera_fault(self) -> str | None:
        """What the agent says of its camera."""
        return self._told.get("camera_fault")

    def open(self, user: str) -> None:
        """Join the agent, unless that is done; `user` keeps the line open until its `close`.

        Raises:
            HardwareError: If nobody answers, or the agent refuses.
        """
        if self._thread is None:
            if not self._address:
                raise HardwareError("which brick? name it with --brick ADDRESS")
            self._line = self._join()
            self._ending.clear()
            self._thread = threading.Thread(target=self._run, name="brick-link", daemon=True)
            self._thread.start()
        self._users.add(user)

    def close(self, user: str) -> None:
        """Hang up when nobody uses the line any more; idempotent."""
        self._users.discard(user)
        if self._users or self._thread is None:
            return
        self._ending.set()
        self._hang_up()
        self._thread.join(timeout=PATIENCE_S)
        self._thread = None
        self._wishes.clear()

    def say(self, do: str, **rest: Any) -> None:
        """Send one command.

        Raises:
            HardwareError: If the line is lost or the brick silent; it stops by itself then.
        """
        fault = self.fault
        if fault is not None:
            raise HardwareError(fault)
        try:
            self._send(do, **rest)
        except OSError as error:
            self._hang_up()  # half a message may be on the way
            raise HardwareError(
                f"the line to the brick at {self._address} is lost ({error}); trying again"
            ) from error

    def wish(self, key: str, do: str, **rest: Any) -> None:
        """Send a command that holds for the whole connection, and again after each new joining."""
        self._wishes[key] = {"do": do, **rest}
        self.say(do, **rest)

    def forget(self, key: str) -> None:
        """Stop repeating a wish."""
        self._wishes.pop(key, None)

    def answer(self, name: str) -> Any:
        """Wait for the answer to a question just asked.

        Raises:
            HardwareError: If the agent says that it failed, or says nothing.
        """
        deadline_s = time.monotonic() + PATIENCE_S
        while True:
            try:
                message = self._answers.get(timeout=max(0.0, deadline_s - time.monotonic()))
            except queue.Empty:
                raise HardwareError(f"the brick at {self._address} gives no answer") from None
            if "failed" in message:
                raise HardwareError(f"brick {self._address}: {message['failed']}")
            if name in message:
                return message[name]

    def sensors(self) -> dict[str, Any]:
        """Return what the brick last told of its sensors, which is at most 0.5 s old."""
        fault = self.fault or self._told.get("fault")
        if fault is not None:
            raise HardwareError(fault)
        return dict(self._told.get("sensors") or {})

    def take_button(self) -> str | None:
        """Return the last button that was pressed since the last call."""
        buttons, self._buttons = self._buttons, []
        return "stop" if "stop" in buttons else buttons[-1] if buttons else None

    # Joining ------------------------------------------------------------------------------------

    def _join(self) -> socket.socket:
        host, _, port = self._address.partition(":")
        try:
            line = socket.create_connection((host, int(port or PORT)), timeout=PATIENCE_S)
        except ValueError:
            raise ConfigurationError(f"--brick {self._address} is no address:port") from None
        except OSError as error:
            raise HardwareError(
                f"no agent answers at {host} port {port or PORT} ({error.strerror or error}); "
                f"start it with: drivelesson brick agent {host}"
            ) from error
        try:
            self._shake_hands(line, host)
        except (OSError, ValueError, KeyError) as error:
            line.close()
            raise HardwareError(
                f"what answers at {host} port {port or PORT} is no agent of this version "
                f"({error}); renew it with: drivelesson brick agent {host}"
            ) from error
        except HardwareError:
            line.close()
            raise
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        line.settimeout(PING_S)
        self._offset_s, self._lost, self._told = None, None, {}
        self._heard_s = time.monotonic()
        return line

    def _shake_hands(self, line: socket.socket, host: str) -> None:
        self._unpacker = unpacker = Unpacker()
        hello = _next_message(line, unpacker)
        if hello["hello"] != PROTOCOL:
            raise ValueError(f"it speaks version {hello['hello']}")
        proof = prove(self._secret or kept_secret(host), hello["nonce"])
        line.sendall(pack_json({"do": "join", "proof": proof}))
        verdict = _next_message(line, unpacker)
        if "refused" in verdict:
            raise HardwareError(
                f"the brick at {host} refuses: {verdict['refused']}; " + _advice(verdict, host)
            )

    # The thread ---------------------------------------------------------------------------------

    def _run(self) -> None:
        while not self._ending.is_set():
            line = self._line
            try:
                if line is None:
                    self._rejoin()
                else:
                    self._listen(line)
            except (OSError, ValueError, KeyError, HardwareError, ConfigurationError) as error:
                self._lost = str(error)
                self._hang_up()
                self._ending.wait(REJOIN_S)

    def _rejoin(self) -> None:
        self._line = self._join()
        for wish in list(self._wishes.values()):
            self._send(**wish)

    def _listen(self, line: socket.socket) -> None:
        """Take in messages until the line breaks, and ping meanwhile."""
        pinged_s = 0.0
        while not self._ending.is_set():
            if time.monotonic() - pinged_s > PING_S / 2:
                pinged_s = time.monotonic()
                self._send("ping", t=pinged_s)
            try:
                data = line.recv(65536)
            except TimeoutError:
                continue
            if not data:
                raise OSError("the brick hung up")
            self._heard_s = time.monotonic()
            for kind, body in self._unpacker.feed(data):
                if kind == b"J":
                    self._take_message(json.loads(body))
                else:
                    self._take_picture(body)

    def _take_message(self, message: dict[str, Any]) -> None:
        if "t" in message:
            self._measure_offset(message["t"])
            self._told = message
            if message.get("button"):
                self._buttons.append(message["button"])
        elif "fault" in message:
            self._told = {**self._told, "fault": message["fault"]}
        else:
            self._answers.put(message)

    def _measure_offset(self, said_s: float) -> None:
        """Learn how far the clocks are apart from the quickest message; 1 ms/s may drift."""
        offset_s = self._heard_s - said_s
        if self._offset_s is None:
            self._offset_s = offset_s
        self._offset_s = min(self._offset_s + 0.0001, offset_s)

    def _take_picture(self, body: bytes) -> None:
        frame_id, taken_s, width, height, encoding = PICTURE.unpack_from(body)
        self._send("seen", frame=frame_id)
        if self.on_picture is not None and self._offset_s is not None:
            self.on_picture(
                Picture(
                    data=body[PICTURE.size :],
                    taken_s=min(taken_s + self._offset_s, self._heard_s),
                    width=width,
                    height=height,
                    encoding=ENCODINGS[encoding],
                )
            )

    def _send(self, do: str, **rest: Any) -> None:
        with self._sending:
            if self._line is None:
                raise OSError("not connected")
            self._line.sendall(pack_json({"do": do, **rest}))

    def _hang_up(self) -> None:
        line, self._line = self._line, None
        if line is not None:
            with contextlib.suppress(OSError):
                line.shutdown(socket.SHUT_RDWR)
            line.close()


class RemoteBody:
    """A body at the other end of a link, with the same methods as the brick's own."""

    def __init__(self, link: BrickLink, **ports: str) -> None:
        self._link = link
        self._ports = ports

    def open(self) -> None:
        """Join the brick and have it find its motors and sensors."""
        self._link.open("body")
        self._link.wish("body", "open", **self._ports)
        self._link.answer("opened")

    def run(self, left_dps: float, right_dps: float, time_ms: int) -> None:
        """Turn the wheels for at most `time_ms`."""
        self._link.say("run", left=left_dps, right=right_dps, ms=time_ms, t=time.monotonic())

    def stop(self) -> None:
        """Stop the motors; if the line is lost the brick does so by itself."""
        with contextlib.suppress(HardwareError):
            self._link.say("stop", t=time.monotonic())

    def positions(self) -> list[float]:
        """How far each wheel has turned, in degrees; asks the brick and waits."""
        self._link.say("positions")
        return [float(degrees) for degrees in self._link.answer("positions")]

    def sense(self) -> dict[str, Any]:
        """Return what the brick last told."""
        return self._link.sensors()

    def take_button(self) -> str | None:
        """Return the brick's button that was pressed."""
        return self._link.take_button()

    def show(self, mode: str, address: str) -> None:
        """Show mode and address on the brick."""
        with contextlib.suppress(HardwareError):
            self._link.wish("show", "show", mode=mode, address=address)

    def close(self) -> None:
        """Stop the motors and hang up, unless the camera still uses the line."""
        self.stop()
        self._link.forget("body")
        self._link.forget("show")
        with contextlib.suppress(HardwareError):
            self._link.say("close")
        self._link.close("body")


def secret_path(host: str) -> Path:
    """Where `drivelesson brick agent` keeps the secret that it shares with a brick."""
    home = os.environ.get("XDG_CONFIG_HOME") or str(Path.home() / ".config")
    return Path(home) / "drivelesson" / f"brick-{host}.secret"


def kept_secret(host: str) -> str:
    """Read the kept secret of a brick.

    Raises:
        HardwareError: If there is none.
    """
    given = os.environ.get("DRIVELESSON_BRICK_SECRET")
    if given:
        return given
    try:
        return secret_path(host).read_text().strip()
    except OSError:
        raise HardwareError(
            f"no secret is known for the brick at {host}; "
            f"make one with: drivelesson brick agent {host}, or give --brick-secret"
        ) from None


def _advice(verdict: dict[str, Any], host: str) -> str:
    if "secret" in verdict["refused"]:
        return f"give --brick-secret, or make a new one with: drivelesson brick agent {host}"
    return "stop the other server first"


def _next_message(line: socket.socket, unpacker: Unpacker) -> dict[str, Any]:
    while True:
        data = line.recv(4096)
        if not data:
            raise OSError("it hung up")
        for _kind, body in unpacker.feed(data):
            message: dict[str, Any] = json.loads(body)
            return message
