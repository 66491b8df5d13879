"""The agent: lends the brick's body and camera to one controller at a time."""

import json
import os
import select
import socket
import time
from typing import Any, Dict, List, Optional

from robot.brick.agent.body import BrickBody
from robot.brick.agent.ports import HardwareError
from robot.brick.agent.wire import ENCODINGS, HEAD, PICTURE, PROTOCOL, Unpacker, pack_json, prove
from robot.capture.reader import CameraReader
from robot.capture.v4l2 import VideoFrame

WATCHDOG_S = 0.5
"""So long after the last command the motors are stopped, whatever was asked."""
SILENCE_S = 1.5
"""A controller that says nothing for so long is gone, and another may come."""
STALE_S = 0.3
"""A command that was held up on the way for longer than this is not carried out."""


class Caller:
    """One connection. It may command only once it has proved that it knows the secret."""

    def __init__(self, line: socket.socket, name: str, now_s: float) -> None:
        self.line = line
        self.name = name
        self.nonce = os.urandom(16).hex()
        self.unpacker = Unpacker()
        self.outbox = b""
        self.heard_s = now_s
        self.offset_s = None  # type: Optional[float]

    def delay_s(self, said_s: float, now_s: float) -> float:
        """How much longer than the quickest word this one took; the clocks may drift 1 ms/s."""
        offset_s = now_s - said_s
        if self.offset_s is None:
            self.offset_s = offset_s
        self.offset_s = min(self.offset_s + 0.001 * (now_s - self.heard_s), offset_s)
        return offset_s - self.offset_s

    def say(self, message: Dict[str, Any]) -> None:
        """Put a message into the outbox; small ones never pile up, they are asked for."""
        self.outbox += pack_json(message)

    def flush(self) -> None:
        """Send what the line takes without waiting."""
        if self.outbox:
            try:
                sent = self.line.send(self.outbox)
            except BlockingIOError:
                return
            self.outbox = self.outbox[sent:]


class Agent:
    """Serves one controller at a time on one thread; nothing in it ever waits for the network."""

    def __init__(self, listener: socket.socket, secret: str, root: str = "/") -> None:
        listener.setblocking(False)
        self._listener = listener
        self._secret = secret
        self._root = root
        self._callers = []  # type: List[Caller]
        self._controller = None  # type: Optional[Caller]
        self._body = None  # type: Optional[BrickBody]
        self._eye = None  # type: Optional[CameraReader]
        self._commanded_s = None  # type: Optional[float]
        self._told_s = 0.0
        self._told_fault = None  # type: Optional[str]
        self._frame_id = 0
        self._frame_free = True
        self._newest = None  # type: Optional[VideoFrame]

    def serve_forever(self) -> None:
        """Serve until interrupted; the motors stand whenever this ends."""
        try:
            while True:
                self.turn()
        finally:
            self._release_controller()

    def turn(self) -> None:
        """Wait at most 50 ms for something to do, and do it."""
        readers = [self._listener] + [caller.line for caller in self._callers]  # type: List[Any]
        if self._eye is not None and self._eye.video is not None:
            readers.append(self._eye.video)
        writers = [caller.line for caller in self._callers if caller.outbox]
        readable, writable, _ = select.select(readers, writers, [], 0.05)
        now_s = time.monotonic()
        if self._listener in readable:
            self._accept(now_s)
        for caller in list(self._callers):
            try:
                if caller.line in readable:
                    self._hear(caller, now_s)
                caller.flush()
            except Exception as error:  # top of the loop: whatever a caller says, go on
                self._drop(caller, "{}: {}".format(type(error).__name__, error))
        self._watch(now_s)
        self._look(now_s)
        self._tell(now_s)

    def _accept(self, now_s: float) -> None:
        line, address = self._listener.accept()
        line.setblocking(False)
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        line.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 65536)
        caller = Caller(line, address[0], now_s)
        self._callers.append(caller)
        caller.say({"hello": PROTOCOL, "nonce": caller.nonce})

    def _hear(self, caller: Caller, now_s: float) -> None:
        data = caller.line.recv(65536)
        if not data:
            raise EOFError("it hung up")
        words = [json.loads(body.decode()) for kind, body in caller.unpacker.feed(data)]
        moves = [word for word in words if word["do"] in ("run", "stop")]
        for word in words:
            if caller is not self._controller:
                self._admit(caller, word)
            elif word["do"] not in ("run", "stop"):
                self._obey(caller, word, now_s)
            elif word is moves[-1]:  # of several that wait, only the last counts
                self._move(caller, word, now_s)
        caller.heard_s = now_s

    def _admit(self, caller: Caller, word: Dict[str, Any]) -> None:
        from hmac import compare_digest

        proof = prove(self._secret, caller.nonce)
        if word["do"] != "join" or not compare_digest(str(word["proof"]), proof):
            self._refuse(caller, "wrong secret")
        elif self._controller is not None:
            self._refuse(caller, "busy: {} has the robot".format(self._controller.name))
        else:
            self._controller = caller
            self._frame_free = True
            caller.say({"welcome": PROTOCOL})
            print("{} has the robot".format(caller.name), flush=True)

    def _refuse(self, caller: Caller, why: str) -> None:
        caller.say({"refused": why})
        caller.flush()
        raise EOFError(why)

    def _obey(self, caller: Caller, word: Dict[str, Any], now_s: float) -> None:
        do = word["do"]
        if do == "ping":
            caller.delay_s(float(word["t"]), now_s)
        elif do == "open":
            self._open_body(caller, word)
        elif do == "close":
            self._close_body()
        elif do == "video":
            self._close_eye()
            self._eye = CameraReader(
                word["device"], word["width"], word["height"], word["rate"], word["encoding"]
            )
        elif do == "blind":
            self._close_eye()
        elif do == "seen":
            self._frame_free = True
        elif do == "show" and self._body is not None:
            self._body.show(word["mode"], word["address"])
        elif do == "positions" and self._body is not None:
            caller.say({"positions": self._body.positions()})

    def _open_body(self, caller: Caller, word: Dict[str, Any]) -> None:
        self._close_body()
        body = BrickBody(word["left"], word["right"], word["ultrasonic"], word["touch"], self._root)
        try:
            body.open()
        except HardwareError as error:
            caller.say({"failed": str(error)})
            return
        self._body = body
        caller.say({"opened": body.sense()})

    def _move(self, caller: Caller, word: Dict[str, Any], now_s: float) -> None:
        body = self._body
        if body is None:
            return
        late_s = caller.delay_s(float(word["t"]), now_s)
        try:
            if word["do"] == "stop":
                body.stop()
            elif late_s <= STALE_S:
                time_ms = min(int(word["ms"]), int(WATCHDOG_S * 1000))
                body.run(float(word["left"]), float(word["right"]), time_ms)
                self._commanded_s = now_s
        except HardwareError as error:
            caller.say({"fault": str(error)})

    def _watch(self, now_s: float) -> None:
        """Stop the motors, and drop the controller, when it has been silent for too long."""
        if self._commanded_s is not None and now_s - self._commanded_s > WATCHDOG_S:
            self._commanded_s = None
            if self._body is not None:
                self._body.stop()
        for caller in list(self._callers):
            if now_s - caller.heard_s > SILENCE_S:
                self._drop(caller, "it fell silent")

    def _look(self, now_s: float) -> None:
        """Send the newest picture if the last one has arrived; older ones are dropped."""
        if self._eye is None or self._controller is None:
            return
        self._newest = self._eye.look(now_s) or self._newest
        video = self._eye.video
        if self._newest is None or video is None or not self._frame_free:
            return
        self._frame_id += 1
        head = PICTURE.pack(
            self._frame_id,
            self._newest.taken_s,
            video.width,
            video.height,
            ENCODINGS.index(video.encoding),
        )
        body = head + self._newest.data
        self._controller.outbox += HEAD.pack(b"F", len(body)) + body
        self._frame_free, self._newest = False, None
        self._told_fault = None

    def _tell(self, now_s: float) -> None:
        """Tell the controller of sensors, buttons and faults, ten times a second."""
        caller = self._controller
        if caller is None or now_s - self._told_s < 0.1 or len(caller.outbox) > 65536:
            return
        self._told_s = now_s
        message = {"t": now_s}  # type: Dict[str, Any]
        if self._body is not None:
            try:
                message.update(sensors=self._body.sense(), button=self._body.take_button())
            except HardwareError as error:
                message.update(fault=str(error))
        if self._eye is not None:
            message.update(camera_fault=self._eye.fault)
        caller.say(message)

    def _drop(self, caller: Caller, why: str) -> None:
        print("{} left: {}".format(caller.name, why), flush=True)
        self._callers.remove(caller)
        caller.line.close()
        if caller is self._controller:
            self._release_controller()

    def _release_controller(self) -> None:
        self._controller = None
        self._close_body()
        self._close_eye()

    def _close_body(self) -> None:
        self._commanded_s = None
        if self._body is not None:
            self._body.close()
            self._body = None

    def _close_eye(self) -> None:
        self._newest = None
        if self._eye is not None:
            self._eye.close()
            self._eye = None
