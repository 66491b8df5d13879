"""Serves a bench robot in real time, and drives it with a pilot's client."""

from __future__ import annotations

import contextlib
import json
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Self

from websockets.sync.client import ClientConnection, connect

from robot.clock import RealClock
from robot.devices.rig import Rig
from robot.policy.registry import make_policy
from robot.store.folder import Storage
from robot.testing import FakeCamera, FakeDriver
from server.access.certificates import Certificates
from server.access.gateway import NetworkGateway
from server.access.pairing import Pairing
from server.app import create_app
from server.config import Config
from server.lab.served import served
from server.persistence import Persistence
from server.protocol import encode_acknowledgement, parse_picture
from server.services import Services

WEB = Path(__file__).resolve().parents[2] / "web"
STANDING_AFTER_S = 60.0


class LiveServer:
    """A running server: its address, and the parts behind it."""

    def __init__(self, address: str, services: Services) -> None:
        self.address = address
        self.services = services
        self.rig = services.robot
        self.driver, self.camera = self.rig.driver, self.rig.camera
        self.hub = services.hub

    def ws(self, path: str) -> str:
        return self.address.replace("http", "ws", 1) + path

    def pilot(self) -> Pilot:
        return Pilot(self.ws("/ws/drive"))

    @property
    def port(self) -> int:
        return int(self.address.rsplit(":", 1)[1])


@contextlib.contextmanager
def live_server(
    config: Config | None = None,
    camera: FakeCamera | None = None,
    pairing: Pairing | None = None,
    certificates: Certificates | None = None,
    data: Path | None = None,
) -> Iterator[LiveServer]:
    """While the `with` block runs, serve a bench robot on loopback; with `data`, it saves there."""
    clock = camera.clock if camera else RealClock()
    config = config or Config(port=0, web=WEB)
    rig = Rig(FakeDriver(), camera or FakeCamera(clock), make_policy("published-8"), clock)
    persistence = Persistence(Storage(data), rig) if data else None
    gateway = NetworkGateway(config, rig.clock, pairing)
    if certificates is not None:
        gateway.tls_files = str(certificates.key), str(certificates.chain)
    services = Services(config, rig, name="bench", persistence=persistence, gateway=gateway)
    with (
        rig,
        served(create_app(services), config) as address,
        persistence or contextlib.nullcontext(),
    ):
        yield LiveServer(address, services)


class Pilot:
    """A client without a screen: holds a move, and sends a heartbeat every 100 ms until it ends."""

    def __init__(self, url: str, *, sees: bool = False, **options: Any) -> None:
        self._stack = contextlib.ExitStack()
        self.picture: int | None = None
        self.socket: ClientConnection = self._stack.enter_context(
            connect(url, **{"compression": None, "open_timeout": 60, **options})
        )
        self.messages: list[dict[str, Any]] = []
        self.held: str | None = None
        self.seq = 0
        self.is_silent = False
        self._lock = threading.Lock()
        self._ending = threading.Event()
        self._news = threading.Condition()
        self._threads = [
            threading.Thread(target=self._listen, daemon=True),
            threading.Thread(target=self._beat, daemon=True),
        ]
        if sees:
            video = connect(url.replace("/ws/drive", "/ws/video"), compression=None, **options)
            self._video = self._stack.enter_context(video)
            self._threads.append(threading.Thread(target=self._watch, daemon=True))
        for thread in self._threads:
            thread.start()
        self.hello = self.wait_for(lambda m: m["type"] == "hello")

    def _listen(self) -> None:
        with contextlib.suppress(Exception):
            for text in self.socket:
                with self._news:
                    self.messages.append(json.loads(text))
                    self._news.notify_all()

    def _watch(self) -> None:
        with contextlib.suppress(Exception):
            for message in self._video:
                picture = parse_picture(message)
                self.picture = picture.frame_id
                self._video.send(encode_acknowledgement(picture.frame_id))

    def _beat(self) -> None:
        while not self._ending.wait(0.1):
            if not self.is_silent:
                with contextlib.suppress(Exception):
                    self._say_drive()

    def _say_drive(self) -> None:
        self._say(type="drive", held=self.held)

    def _say(self, **order: Any) -> None:
        """Send an order with the proof that it needs: the shown picture and the newest nonce."""
        with self._lock:
            self.seq += 1
            state = self.state if self.states else {"frame": None, "nonce": None}
            frame = self.picture or state["frame"]
            self.send(**order, frame=frame, seq=self.seq, nonce=state["nonce"])

    def send(self, **message: Any) -> None:
        self.socket.send(json.dumps(message))

    def hold(self, held: str | None) -> None:
        self.held = held
        self._say_drive()

    def mode(self, mode: str) -> None:
        if mode != "stopped" and self.picture is None:
            self.wait_for_state_with(lambda state: state["frame"] is not None)
        self._say(type="mode", mode=mode)

    def wait_for_state_with(
        self, wanted: Callable[[dict[str, Any]], bool], within_s: float = STANDING_AFTER_S
    ) -> dict[str, Any]:
        """Return the newest state that meets the condition, or else the first later one."""
        return self.wait_for(
            lambda m: m["type"] == "state" and wanted(m),
            within_s,
            seen=max(len(self.messages) - 1, 0),
        )

    @property
    def states(self) -> list[dict[str, Any]]:
        return [m for m in self.messages[-100:] if m["type"] == "state"]

    @property
    def state(self) -> dict[str, Any]:
        return self.states[-1]

    def errors(self) -> list[str]:
        return [m["code"] for m in self.messages if m["type"] == "error"]

    def wait_for(
        self,
        wanted: Callable[[dict[str, Any]], bool],
        within_s: float = STANDING_AFTER_S,
        seen: int = 0,
    ) -> dict[str, Any]:
        """Return the first wanted message after the first `seen` messages."""
        deadline = time.monotonic() + within_s
        with self._news:
            while True:
                for message in self.messages[seen:]:
                    if wanted(message):
                        return message
                seen = len(self.messages)
                left = deadline - time.monotonic()
                assert left > 0, f"no such message in {within_s} s: {self.messages[-3:]}"
                self._news.wait(left)

    def wait_for_state(self, within_s: float = STANDING_AFTER_S, **fields: Any) -> dict[str, Any]:
        """Return the newest state with these fields, or the first later one."""
        return self.wait_for_state_with(lambda state: fields.items() <= state.items(), within_s)

    def drive_until(
        self, is_so: Callable[[], bool], held: str = "forward", mode: str = "train"
    ) -> None:
        """Hold a move until a condition holds; start again if a busy machine stopped the robot."""
        self.wait_for(lambda m: m["type"] == "state")
        self.hold(held)
        end_s = time.monotonic() + STANDING_AFTER_S
        while not is_so():
            assert time.monotonic() < end_s, f"the condition never held: {self.messages[-3:]}"
            if not self.states or self.state["mode"] != mode:
                self.mode(mode)
            time.sleep(0.05)

    def close(self) -> None:
        self._ending.set()
        with contextlib.suppress(Exception):
            self._stack.close()
        for thread in self._threads:
            thread.join(2)

    def vanish(self) -> None:
        """Disconnect like a killed browser, without a closing handshake."""
        self._ending.set()
        linger = struct.pack("ii", 1, 0)  # end the connection by a reset
        self.socket.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
        self.socket.socket.shutdown(socket.SHUT_RDWR)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()
