"""`/eye` and `/ws/eye`: the page that makes a phone the robot's camera."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Mapping
from typing import Any

from fastapi import APIRouter, Request, WebSocket
from fastapi.responses import FileResponse, Response

from robot.bodies.phone.camera import PhoneCamera
from robot.errors import ConfigurationError
from server.bodies.eye import EyeClock, parse_frame, parse_text
from server.clients.client import RefusalCounter
from server.clients.rate_limit import RateLimit
from server.clients.telemetry import describe_state
from server.gateway.guard import role_of
from server.gateway.roles import Role
from server.protocol import ProtocolError, encode_acknowledgement, encode_message
from server.routes.sockets import converse, end_with_either
from server.services import Extension, Services, services_of

router = APIRouter()
EYE = Role(
    value="eye",
    paths=re.compile(
        r"/eye(/(messages/)?[a-z-]+\.(js|css))?|/ws/eye|/api/unpair|/(js|css|icons)/.*"
    ),
    start="/eye",
    refusal="This phone is the robot's eye; it may watch and stop, but not drive.",
    purpose="be the robot's eye",
)
"""Role of the phone on the robot. The role allows only the requests of the eye page, because nobody
guards a phone on a robot."""
STATE_EVERY_S = 0.2
_STATE_FIELDS = ("mode", "driven_by", "action", "stop_reason", "emergency", "fault", "frame_age_ms")


@router.get("/eye", include_in_schema=False)
async def eye_page(request: Request) -> Response:
    """Return the page that sends the phone's camera pictures; no other page may use a camera."""
    config = services_of(request).config
    policy = {"permissions-policy": "camera=(self), microphone=(), geolocation=()"}
    return FileResponse(config.web / "eye/index.html", headers=policy)


class _Eye:
    """The websocket of a phone that is the robot's camera; a newer phone replaces it."""

    def __init__(self, websocket: WebSocket, services: Services, camera: PhoneCamera) -> None:
        self._websocket = websocket
        self._services = services
        self._camera = camera
        self._clock = services.robot.clock
        self._eye_clock = EyeClock()
        limits = services.config.limits
        self._pace = RateLimit(per_second=limits.frames_per_second, burst=limits.frames_per_second)
        self._refusals = RefusalCounter(limits.refused_before_closing, services.hub.refused)

    async def run(self) -> None:
        """Serve the phone until it disconnects or another phone replaces it."""
        before, self._camera.source = self._camera.source, self
        ending: asyncio.Task[None] | None = None
        # close in a task: a dead connection takes seconds to close, and STOP must not wait
        if isinstance(before, _Eye):
            ending = asyncio.create_task(before.give_way())
        try:
            await converse(
                self._websocket,
                self._clock,
                hear=self._hear,
                see=self._see,
                sending=self._publish(),
                refusals=self._refusals,
                idle_s=self._services.config.limits.idle_s,
            )
        finally:
            if self._camera.source is self:
                self._camera.source = None
                self._camera.lose()
            if ending is not None:
                await ending

    async def give_way(self) -> None:
        """Close the connection, because another phone is the robot's camera now."""
        await end_with_either(self._websocket.close(4001, "another phone is the eye now"))

    def _hear(self, text: str | bytes) -> None:
        assert isinstance(text, str)  # `converse` passes binary messages to `_see`
        try:
            said = parse_text(text)
        except ProtocolError as error:
            self._refusals.note(error)
            return
        if said["type"] == "pong":
            self._eye_clock.note(said["server_ms"], said["eye_ms"], self._now_ms())
        else:
            self._services.hub.latch_emergency("eye", EYE)

    async def _see(self, data: bytes) -> None:
        if self._camera.source is not self or self._refusals.shut_out.is_set():
            return
        try:
            frame = parse_frame(data)
        except ProtocolError as error:
            self._refusals.note(error)
            return
        await self._websocket.send_bytes(encode_acknowledgement(frame.seq))
        taken_ms = self._eye_clock.to_ours(frame.taken_ms)
        if taken_ms is not None and self._pace.allows(self._clock.now_s()):
            self._camera.offer(frame.picture, taken_ms / 1000, covered=frame.is_covered)

    def _now_ms(self) -> float:
        return 1000 * self._clock.now_s()

    async def _publish(self) -> None:
        options, robot = self._camera.options, self._services.identity.now.name
        size = {"width": options.eye_width, "height": options.eye_height}
        hello = encode_message("hello", **size, rate_hz=options.eye_rate, robot=robot)
        await self._websocket.send_text(hello)
        while True:
            now_ms = self._now_ms()
            await self._websocket.send_text(encode_message("ping", server_ms=now_ms))
            state = describe_state(self._services.robot.loop.state, now_ms)
            await self._websocket.send_text(
                encode_message("state", **{name: state[name] for name in _STATE_FIELDS})
            )
            await self._clock.pause(STATE_EVERY_S)


@router.websocket("/ws/eye")
async def eye(websocket: WebSocket) -> None:
    services = services_of(websocket)
    camera = services.robot.camera
    await websocket.accept()
    if role_of(websocket) not in (Role.PILOT, EYE):
        await websocket.close(4003, "this browser may only watch")
    elif not isinstance(camera, PhoneCamera):
        await websocket.close(4004, "the robot has another camera: serve it with --camera phone")
    else:
        await _Eye(websocket, services, camera).run()


class EyeExtension(Extension):
    """Adds the phone camera's page and websocket to a robot's server."""

    routers = (router,)

    def __init__(self, services: Services, options: Mapping[str, Any]) -> None:
        self._gateway = services.gateway
        self._is_used = isinstance(services.robot.camera, PhoneCamera)
        if self._is_used and not self._gateway.is_secure:
            raise ConfigurationError(
                "phones allow the camera on https pages only: add --tls to --lan, or give "
                "--behind-proxy an https address"
            )

    def greet(self) -> list[str]:
        if not self._is_used:
            return []
        address = self._gateway.address_for(EYE)
        if self._gateway.admits_all:
            return [f"To use a phone as the robot's eye, open {address}"]
        lines = ["With the phone on the robot, scan this:", "", *self._gateway.draw(address)]
        return [*lines, "", f"  or open   {address}", ""]
