"""The connection to a remote brick: the counterpart of `robot.bodies.ev3.agent`.

One thread owns the connection: it joins, receives, pings ten times a second, and joins again after
the connection was lost. A command is sent on its caller's thread, and never waits for an answer.
"""

from __future__ import annotations

import contextlib
import json
import socket
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from robot.bodies.ev3.agent.wire import ENCODINGS, PICTURE
from robot.bodies.ev3.handshake import PATIENCE_S, BrickConnection, dial, join
from robot.clock import Clock, RealClock, Worker
from robot.devkit.pictures import Picture
from robot.errors import ConfigurationError, DriveError
from robot.types import Encoding

SILENCE_S = 0.4
"""Time without a report after which a brick counts as silent, in seconds. A brick sends ten reports
a second. Each move ends by itself after at most this time."""
GONE_S = PATIENCE_S + 1.0
"""Time without a report after which a new connection to the brick is made, in seconds. It is longer
than a brick needs to open its motors and sensors. A new connection is faster than the old one, on
which TCP retries only once a minute after a minute of silence."""
PING_S = 0.1
REJOIN_S = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class RemotePicture(Picture):
    """One frame from the brick, with the times of exposure and arrival on the link's clock."""

    taken_s: float
    came_s: float


class BrickLink:
    """A connection to one brick's agent, shared by its driver and its camera.

    Args:
        address: Host, or host:port.
        secret: The secret shared with the agent; by default the secret saved for this host.
        clock: The clock that times silence.
        dial: Opens the connection.

    Attributes:
        report: The agent's newest report; empty before the first.
        buttons: The buttons that were pressed and that the caller has not taken yet.
    """

    def __init__(
        self,
        address: str,
        secret: str = "",
        clock: Clock | None = None,
        dial: Callable[[tuple[str, int]], socket.socket] = dial,
    ) -> None:
        self.clock = clock or RealClock()
        self._dial = dial
        self.address = address
        self._secret = secret
        self._connection: BrickConnection | None = None
        self._sending = threading.Lock()
        self._ending = threading.Event()
        self._thread: Worker | None = None
        self._answers: deque[dict[str, Any]] = deque()
        self._answered = threading.Event()
        self._opens_again = False
        self._held: dict[str, dict[str, Any]] = {}
        self._received_s = 0.0
        self._offset_s: float | None = None
        self._lost: str | None = None
        self.report: dict[str, Any] = {}
        self.buttons: list[str] = []
        self.on_picture: Callable[[RemotePicture], None] | None = None

    @property
    def fault(self) -> str | None:
        """The connection's fault, as a sentence; None if the brick answers."""
        if self._lost is None and self.clock.now_s() - self._received_s > SILENCE_S:
            return (
                f"the brick at {self.address} does not answer; is it switched on, and in the same "
                "network?"
            )
        return self._lost

    def _lost_sentence(self, why: object) -> str:
        return f"the connection to the brick at {self.address} was lost ({why}); trying again"

    def hold(self, key: str, do: str, **rest: Any) -> None:
        """Send a command. The command is sent again over every new connection, until `release` is
        called.

        The first command connects to the agent.

        Raises:
            DriveError: If nobody answers, or the agent refuses.
        """
        if self._thread is None:
            if not self.address:
                raise DriveError("the brick's address is missing; give it with --brick ADDRESS")
            self._connection = self._join()
            self._answers.clear()
            self._ending.clear()
            self._thread = self.clock.start_thread(self._run, "brick-link")
        self._held[key] = {"do": do, **rest}
        self.send(do, **rest)

    def release(self, *keys: str) -> None:
        """Stop repeating the commands with these keys. If no repeated command remains, close the
        connection. Idempotent."""
        for key in keys:
            self._held.pop(key, None)
        if self._held or self._thread is None:
            return
        self._ending.set()
        self._hang_up()
        self._thread.join(timeout=PATIENCE_S)
        self._thread = None

    def send(self, do: str, **rest: Any) -> None:
        """Send one command. The command is sent even if the brick is silent, because its reports
        may be delayed. Raises DriveError if the connection is lost; then the brick stops by
        itself."""
        lost = self._lost  # read `_lost` once: the thread resets it when it reconnects
        if lost is not None:
            raise DriveError(lost)
        try:
            self._send(do, **rest)
        except OSError as error:
            self._hang_up()  # only a part of the message was sent, so the connection is unusable
            raise DriveError(self._lost_sentence(error)) from error

    def answer(self, name: str) -> Any:
        """Wait for the agent's answer to the last command; raises DriveError if the agent reports
        a failure or does not answer."""
        deadline_s = self.clock.now_s() + PATIENCE_S
        while True:
            if not self._answers:
                self._answered.clear()
            if not self._answers and not self.clock.wait(
                self._answered, max(0.0, deadline_s - self.clock.now_s())
            ):
                raise DriveError(f"the brick at {self.address} does not answer")
            message = self._answers.popleft()
            if "failed" in message:
                raise DriveError(f"brick {self.address}: {message['failed']}")
            if name in message:
                return message[name]

    def _join(self) -> BrickConnection:
        connection = join(self.address, self._secret, self._dial)
        connection.line.settimeout(PING_S)
        self._offset_s, self._lost, self.report = None, None, {}
        self._received_s = self.clock.now_s()
        return connection

    # The thread ---------------------------------------------------------------------------------

    def _run(self) -> None:
        while not self._ending.is_set():
            connection = self._connection
            try:
                if connection is None:
                    self._rejoin()
                else:
                    self._receive(connection)
            except (OSError, ValueError, KeyError, ConfigurationError) as error:
                self._lost = self._lost_sentence(error)
                self._hang_up()
                self.clock.wait(self._ending, REJOIN_S)

    def _rejoin(self) -> None:
        self._connection = self._join()
        self._opens_again = "body" in self._held
        for command in list(self._held.values()):
            self._send(**command)

    def _receive(self, connection: BrickConnection) -> None:
        """Receive messages and send pings until the connection breaks."""
        pinged_s = 0.0
        while not self._ending.is_set():
            if self.clock.now_s() - pinged_s > PING_S:
                pinged_s = self.clock.now_s()
                self._send("ping")
            try:
                for kind, body in connection.receive():
                    self._received_s = self.clock.now_s()
                    if kind == b"J":
                        self._take_message(json.loads(body))
                    else:
                        self._take_picture(body)
            except TimeoutError:
                if self.clock.now_s() - self._received_s > GONE_S:
                    raise OSError(f"the brick sent nothing for {GONE_S:.0f} s") from None

    def _take_message(self, message: dict[str, Any]) -> None:
        if "t" in message:
            self._measure_offset(message["t"])
            self.report = message
            if message.get("button"):
                self.buttons.append(message["button"])
        elif "fault" in message:
            self.report = {**self.report, "fault": message["fault"]}
        else:
            # The body could not be opened after a reconnection. No caller waits for this failure,
            # so raise an error: the next connection tries to open the body again.
            if self._opens_again and "failed" in message:
                raise OSError(message["failed"])
            self._opens_again = self._opens_again and "opened" not in message
            self._answers.append(message)
            self._answered.set()

    def _measure_offset(self, sent_s: float) -> None:
        """Estimate the offset of the clocks from the fastest message. The clocks may drift by 1
        ms/s."""
        offset_s = self._received_s - sent_s
        if self._offset_s is None:
            self._offset_s = offset_s
        self._offset_s = min(self._offset_s + 0.0001, offset_s)

    def _take_picture(self, body: bytes) -> None:
        frame_id, taken_s, width, height, encoding = PICTURE.unpack_from(body)
        self._send("seen", frame=frame_id)
        if self.on_picture is not None and self._offset_s is not None:
            self.on_picture(
                RemotePicture(
                    data=body[PICTURE.size :],
                    taken_s=min(taken_s + self._offset_s, self._received_s),
                    came_s=self._received_s,
                    width=width,
                    height=height,
                    encoding=Encoding(ENCODINGS[encoding]),
                )
            )

    def _send(self, do: str, **rest: Any) -> None:
        with self._sending:
            if self._connection is None:
                raise OSError("not connected")
            self._connection.send({"do": do, **rest})

    def _hang_up(self) -> None:
        connection, self._connection = self._connection, None
        if connection is not None:
            with contextlib.suppress(OSError):
                connection.line.shutdown(socket.SHUT_RDWR)
            connection.line.close()
