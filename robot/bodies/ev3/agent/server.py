"""The agent: lets one controller at a time use the brick's motors, sensors and camera."""

import select
import socket
import time
from typing import Any, Callable, Dict, List, Optional

from robot.bodies.ev3.agent.body import BrickBody
from robot.bodies.ev3.agent.callers import JOIN_S, Caller, CallerLimiter, LimitedLog
from robot.bodies.ev3.agent.inspection import inspect_brick
from robot.bodies.ev3.agent.ports import DriveError
from robot.bodies.ev3.agent.wire import ENCODINGS, PICTURE
from robot.bodies.v4l2.device import VideoFrame
from robot.bodies.v4l2.reader import CameraReader

WATCHDOG_S = 0.5
"""Time without a move after which the motors are stopped in any case, in seconds."""
SILENCE_S = 1.5
"""Time of silence after which a controller counts as gone, so that another controller may join, in
seconds."""
STALE_S = 0.4
"""Each move contains the time of the newest report that the controller had received, by the brick's
clock. If more than `STALE_S` seconds have passed since then, the agent drops the move. Up to 0.1 s
of this delay comes from the reports, which are 0.1 s apart, and the rest from the network."""
REPORT_S = 0.1


class Agent:
    """Serves one controller at a time on one thread, which never waits for the network.

    `clock` has the functions of the module `time`, and `ready` is called like `select.select`.
    """

    def __init__(
        self,
        listener: socket.socket,
        secret: str,
        root: str = "/",
        open_camera: Callable[..., Any] = CameraReader,
        inspect: Callable[[str], Dict[str, Any]] = inspect_brick,
        note: Optional[Callable[[str], None]] = None,
        clock: Any = time,
        ready: Callable[..., Any] = select.select,
    ) -> None:
        self._clock = clock
        self._ready = ready
        self._open_camera = open_camera
        self._inspect = inspect
        self._secret = secret
        self._root = root
        self._note = note or LimitedLog().note
        self._limiter = CallerLimiter(listener, self._note)
        self._controller = None  # type: Optional[Caller]
        self._body = None  # type: Optional[BrickBody]
        self._reader = None  # type: Any
        self._commanded_s = None  # type: Optional[float]
        self._reported_s = 0.0
        self._frame_id = 0
        self._is_frame_free = True
        self._newest = None  # type: Optional[VideoFrame]
        self._picture_age_s = None  # type: Optional[float]

    def serve_forever(self) -> None:
        """Serve until the program is interrupted, and stop the motors at the end in any case."""
        try:
            while True:
                self.tick()
        finally:
            self.close()

    def close(self) -> None:
        self._release_controller()
        for caller in list(self._limiter.callers):
            self._limiter.drop(caller, "the agent ends")
        self._limiter.listener.close()

    def tick(self) -> None:
        """Wait at most 50 ms for events, and handle them."""
        callers = list(self._limiter.callers)
        readers = [caller.line for caller in callers]  # type: List[Any]
        if self._limiter.is_open(self._clock.monotonic()):
            readers.append(self._limiter.listener)
        if self._reader is not None and self._reader.video is not None:
            readers.append(self._reader.video)
        writers = [caller.line for caller in callers if caller.outbox]
        readable, writable, _ = self._ready(readers, writers, [], 0.05)
        now_s = self._clock.monotonic()
        for caller in callers:
            try:
                if caller.line in readable:
                    self._receive(caller, now_s)
                caller.flush()
            except Exception as error:  # outermost handler: no caller's message may end the loop
                self._drop(caller, "{}: {}".format(type(error).__name__, error))
        if self._limiter.listener in readable:
            self._limiter.accept(now_s)
        self._watch(now_s)
        try:
            self._send_picture(now_s)
            self._report(now_s)
        except EOFError as error:
            if self._controller is not None:
                self._drop(self._controller, str(error))

    def _receive(self, caller: Caller, now_s: float) -> None:
        commands = []
        for message in caller.receive():
            if caller.has_joined:
                commands.append(message)
            else:
                self._admit(caller, message)
        moves = [command for command in commands if command["do"] in ("run", "stop")]
        for command in commands:
            if command["do"] not in ("run", "stop"):
                try:
                    self._obey(caller, command)
                except DriveError as error:
                    caller.send({"failed": str(error)})
            elif command is moves[-1]:  # obey only the last of several waiting moves
                self._move(caller, command, now_s)
        caller.received_s = now_s

    def _admit(self, caller: Caller, message: Dict[str, Any]) -> None:
        if not caller.proves(message, self._secret):
            self._refuse(caller, "wrong secret")
        if self._controller is not None:
            self._refuse(caller, "busy: {} controls the robot".format(self._controller.name))
        caller.welcome(str(message["nonce"]), self._secret)
        self._controller = caller
        self._is_frame_free, self._reported_s = True, 0.0
        self._note("{} controls the robot".format(caller.name))

    def _refuse(self, caller: Caller, why: str) -> None:
        caller.send({"refused": why})
        caller.flush()
        raise EOFError(why)

    def _obey(self, caller: Caller, command: Dict[str, Any]) -> None:
        do = command["do"]
        if do == "ping" and "id" in command:
            caller.send({"pong": command["id"]})
        elif do == "open":
            self._open_body(caller, command)
        elif do == "close":
            self._close_body()
        elif do == "video":
            self._close_reader()
            wanted = ("device", "width", "height", "rate", "encoding")
            self._reader = self._open_camera(*(command[name] for name in wanted))
        elif do == "blind":
            self._close_reader()
        elif do == "seen":
            self._is_frame_free = True
        elif do == "show" and self._body is not None:
            self._body.show(command["mode"], command["address"])
        elif do == "positions" and self._body is not None:
            caller.send({"positions": self._body.positions()})
        elif do == "states" and self._body is not None:
            caller.send({"states": self._body.motors.states()})
        elif do == "inspect":
            caller.send({"inspected": self._inspect(self._root)})

    def _open_body(self, caller: Caller, command: Dict[str, Any]) -> None:
        self._close_body()
        body = BrickBody(command, self._root, self._clock)
        try:
            top_speeds_dps = body.open()
        except DriveError:
            body.close()
            raise
        self._body = body
        caller.send({"opened": {"top_speeds_dps": top_speeds_dps}})

    def _move(self, caller: Caller, command: Dict[str, Any], now_s: float) -> None:
        body = self._body
        if body is None:
            return
        if command["do"] == "stop":  # obey a stop even if it arrives late
            body.stop()
            return
        if not 0.0 <= now_s - float(command["after"]) <= STALE_S:
            return
        try:
            time_ms = min(int(command["ms"]), int(WATCHDOG_S * 1000))
            body.run(float(command["left"]), float(command["right"]), time_ms)
            self._commanded_s = now_s
        except DriveError as error:
            caller.send({"fault": str(error)})

    def _watch(self, now_s: float) -> None:
        """Stop the motors if no move has come for `WATCHDOG_S`. Drop clients that do not join in
        time, and a controller that has fallen silent."""
        if self._commanded_s is not None and now_s - self._commanded_s > WATCHDOG_S:
            self._commanded_s = None
            if self._body is not None:
                self._body.stop()
        for caller in list(self._limiter.callers):
            if not caller.has_joined and now_s - caller.since_s > JOIN_S:
                self._drop(caller, "it did not join")
            elif caller.has_joined and now_s - caller.received_s > SILENCE_S:
                self._drop(caller, "it fell silent")

    def _send_picture(self, now_s: float) -> None:
        """Send the newest picture if the controller has received the last one that was sent. Drop
        the pictures in between."""
        if self._reader is None or self._controller is None:
            return
        picture = self._reader.poll(now_s)
        if picture is not None:
            self._newest = picture
            self._picture_age_s = round(max(0.0, self._clock.monotonic() - picture.taken_s), 4)
        video = self._reader.video
        if self._newest is None or video is None or not self._is_frame_free:
            return
        self._frame_id += 1
        encoding = ENCODINGS.index(video.encoding)
        head = PICTURE.pack(
            self._frame_id, self._newest.taken_s, video.width, video.height, encoding
        )
        self._controller.send_picture(head + self._newest.data)
        self._is_frame_free, self._newest = False, None

    def _report(self, now_s: float) -> None:
        """Report sensors, buttons and faults to the controller, ten times a second."""
        caller = self._controller
        if caller is None or now_s - self._reported_s < REPORT_S or len(caller.outbox) > 65536:
            return
        self._reported_s = now_s
        message = {"t": now_s}  # type: Dict[str, Any]
        if self._body is not None:
            try:
                message.update(button=self._body.take_button(), sensors=self._body.sense())
            except DriveError as error:
                message.update(fault=str(error))
        if self._reader is not None:
            message.update(camera_fault=self._reader.fault, picture_age_s=self._picture_age_s)
        caller.send(message)

    def _drop(self, caller: Caller, why: str) -> None:
        self._limiter.drop(caller, why)
        if caller is self._controller:
            self._release_controller()

    def _release_controller(self) -> None:
        self._controller = None
        self._close_body()
        self._close_reader()

    def _close_body(self) -> None:
        self._commanded_s = None
        if self._body is not None:
            self._body.close()
            self._body = None

    def _close_reader(self) -> None:
        self._newest, self._picture_age_s = None, None
        if self._reader is not None:
            self._reader.close()
            self._reader = None
