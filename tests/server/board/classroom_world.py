"""Runs a class in virtual time, with the robots' real apps, the real board, and a network that can
fail."""

import asyncio
import contextlib
import random
from collections.abc import AsyncIterator, Callable, Coroutine, Mapping
from typing import Any

import httpx

from robot.testing import FakeCamera, LinkConditions, VirtualClock
from robot.types import Action
from server.access.config import NetworkConfig
from server.access.gateway import NetworkGateway
from server.access.pairing import Pairing, cookie_name
from server.app import create_app
from server.board.board import Board
from server.board.class_key import ClassKey, endpoint
from server.board.classroom import Classroom
from server.board.robot_link import RobotLink
from server.board.teacher_session import Status
from server.board.transport import HttpAnswer, RobotAddress, ServerPlace, UnreachableError
from server.config import Config
from server.gateway.roles import Role
from server.services import Services
from tests.server.virtual import ServedWorld, Socket, with_first_argument
from tests.server.virtual_connections import Exchange
from tests.server.virtual_server import WEB, threads_of_the_pool_inline

KEY = ClassKey("k" * 40)
PATIENCE_S = 4.0
STOP_S = 0.3
FAULTS = ("none", "slow", "gone", "silent", "half", "nonsense", "wrong key", "no class", "refuses")
OPEN_FAULTS = ("none", "slow")
"""Network faults in spite of which the board reaches a robot."""


class Pupil(ServedWorld):
    """A robot of the class."""

    def __init__(self, clock: VirtualClock, port: int, key: ClassKey | None) -> None:
        super().__init__(clock, camera=FakeCamera(clock, rate_hz=10.0), seed=port)
        self.port, self.fault = port, "none"
        self.pairing = Pairing(10)
        self._begin(f"R{port}", key)
        pair = self.pairing.redeem(self.pairing.tokens[Role.PILOT], clock.now_s())
        self._cookie = f"{cookie_name(NetworkConfig.of(self.services.config))}={pair.secret}"

    def _begin(self, name: str, key: ClassKey | None) -> None:
        config = Config(port=self.port, web=WEB)
        self.classroom = Classroom(key) if key else None
        self.services = Services(
            config,
            self.rig,
            name=name,
            gateway=NetworkGateway(config, self.rig.clock, self.pairing),
            options={"classroom": self.classroom},
        )
        self.hub = self.services.hub

    def connect(self, path: str, on_message: Callable[[str | bytes], None]) -> Socket:
        """Open a websocket like a pupil's phone."""
        headers = {"host": f"127.0.0.1:{self.port}", "cookie": self._cookie}
        socket = Socket(self, path, on_message, headers)
        self._sockets.append(socket)
        return socket

    def restart(self) -> None:
        """Forget all sessions, like a restarted server; the test starts the hub."""
        before = self.classroom
        self._begin("Anew", KEY)
        if before is not None and self.classroom is not None:
            self.classroom.id = before.id
        self.__dict__["app"] = create_app(self.services)
        for socket in self._sockets:
            socket.cut()


def latched(pupil: Pupil) -> bool:
    """True while an emergency stop holds the robot."""
    return pupil.loop.state.emergency and pupil.driver.now is Action.STOP


class Absent:
    """An announced robot, which has only an address and a network fault."""

    def __init__(self, port: int, fault: str) -> None:
        self.port, self.fault = port, fault


class VirtualNetwork:
    """The board's transport: it calls the robots' apps directly unless a fault prevents that."""

    def __init__(self, pupils: Mapping[int, Any], dice: random.Random) -> None:
        self.pupils: Mapping[int, Any] = pupils
        self._dice = dice
        self.requests: list[tuple[int, str]] = []
        self.sees_as: dict[int, str] = {}
        """The endpoints that the board sees, by port, if an attacker is between board and robot."""
        self.hosts: dict[int, str] = {}
        """The new addresses, by port, that the network has given to robots since then."""

    async def locate(self, address: RobotAddress) -> ServerPlace:
        at = self.sees_as.get(address.port, endpoint(address.host, address.port))
        host = self.hosts.get(address.port, address.host)
        return ServerPlace(RobotAddress(host, address.port), at)

    async def request(
        self,
        place: ServerPlace,
        method: str,
        path: str,
        headers: Mapping[str, str],
        body: bytes = b"",
    ) -> HttpAnswer:
        pupil = self.pupils[place.address.port]
        self.requests.append((pupil.port, f"{method} {path}"))
        if place.address.host != self.hosts.get(pupil.port, place.address.host):
            raise UnreachableError("no route to host")
        fault = getattr(pupil, "fault", "none")
        if fault == "gone":
            raise UnreachableError("connection refused")
        if fault == "silent":
            await asyncio.sleep(PATIENCE_S)
            raise UnreachableError("the robot does not answer in time")
        if fault == "slow":
            await asyncio.sleep(self._dice.uniform(0.02, 0.1))
        if fault == "refuses":
            return HttpAnswer(503, b'{"detail": "Too many."}')
        if fault == "nonsense":
            return HttpAnswer(200, self._dice.randbytes(40))
        url = f"http://127.0.0.1:{pupil.port}{path}"
        exchange = Exchange(
            pupil, httpx.Request(method, url, headers=dict(headers), content=body), None
        )
        await exchange.task
        data = b"".join(exchange.chunks)
        if fault == "half":
            if path.endswith("/file") and method == "GET":
                raise UnreachableError("the robot's answer is incomplete")
            data = data[: len(data) // 2]
        return HttpAnswer(exchange.status or 500, data)

    @contextlib.asynccontextmanager
    async def connect(
        self, place: ServerPlace, path: str, headers: Mapping[str, str]
    ) -> AsyncIterator[Any]:
        pupil = self.pupils[place.address.port]
        if pupil.fault in ("gone", "silent", "refuses"):
            raise UnreachableError("connection refused")
        channel = _Channel(pupil, path, headers)
        try:
            yield channel
        finally:
            channel.socket.cut()


class _Channel:
    def __init__(self, pupil: Pupil, path: str, headers: Mapping[str, str]) -> None:
        self._pupil = pupil
        self._inbox: asyncio.Queue[str | bytes] = asyncio.Queue()
        host = {"host": f"127.0.0.1:{pupil.port}"}
        self.socket = Socket(pupil, path, self._inbox.put_nowait, {**host, **headers})
        pupil._sockets.append(self.socket)

    async def recv(self) -> str | bytes:
        taking = asyncio.ensure_future(self._inbox.get())
        ending = self.socket.task
        await asyncio.wait([taking, ending], return_when=asyncio.FIRST_COMPLETED)
        if taking.done():
            return taking.result()
        taking.cancel()
        raise UnreachableError("it has closed the connection")

    async def send(self, message: str | bytes) -> None:
        if self.socket.is_closed:
            raise UnreachableError("it has closed the connection")
        self.socket.send(message)


class ClassWorld:
    """Robots and their board."""

    def __init__(self, clock: VirtualClock, pupils: list[Pupil], seed: int) -> None:
        self.clock, self.pupils = clock, {pupil.port: pupil for pupil in pupils}
        self.dice = random.Random(seed)
        self.network = VirtualNetwork(self.pupils, self.dice)
        self.board = Board(KEY, self.network, clock)

    def link(self, pupil: Pupil) -> RobotLink:
        [found] = [r for r in self.board.robots.values() if r.address.port == pupil.port]
        return found

    async def ask(
        self, of: Any, method: str, path: str, headers: Mapping[str, str], body: bytes = b""
    ) -> HttpAnswer:
        """Send a request to the robot, or another served application, with this port."""
        place = ServerPlace(RobotAddress("127.0.0.1", of.port), "")
        return await VirtualNetwork({of.port: of}, self.dice).request(
            place, method, path, headers, body
        )

    async def until(self, is_so: Callable[[], object], within_s: float, what: str = "") -> float:
        start_s = self.clock.now_s()
        while not is_so():
            assert self.clock.now_s() - start_s < within_s, f"not within {within_s} s: {what}"
            await self.clock.pause(0.005)
        return self.clock.now_s() - start_s

    async def first(self) -> tuple[Pupil, RobotLink]:
        """Wait until all robots are there; return the first of them, and the board's link to it."""
        await self.until_there()
        pupil = next(iter(self.pupils.values()))
        return pupil, self.link(pupil)

    async def until_there(self, pupils: list[Pupil] | None = None, within_s: float = 20.0) -> None:
        pupils = list(self.pupils.values()) if pupils is None else pupils
        await self.until(
            lambda: all(self.link(p).status is Status.THERE and self.link(p).state for p in pupils),
            within_s,
            str([(p.port, p.fault, self.link(p).status, self.link(p).detail) for p in pupils]),
        )

    async def drive_all(self, pupils: list[Pupil]) -> None:
        """Have each robot drive forward, each with a phone of its own."""
        for pupil in pupils:
            phone = await pupil.pilot(sees=True)
            await phone.wait_for_state()
            phone.mode("train")
            phone.hold("forward")
            await pupil.until(lambda p=pupil: p.driver.now is Action.FORWARD, 5.0, "a robot drives")


def in_class_time(
    robots: int = 3,
    faults: Callable[[random.Random, int], str] = lambda dice, i: "none",
    is_told: bool = True,
) -> Callable[[Callable[..., Coroutine[Any, Any, None]]], Callable[..., None]]:
    """Run a test that is a coroutine; its first argument is a class.

    Args:
        robots: The number of robots.
        faults: Returns the fault that a robot has from the start.
        is_told: True if the board knows the robots' addresses.
    """

    async def run(scenario: Any, clock: VirtualClock, seed: int) -> None:
        dice = random.Random(seed)
        async with contextlib.AsyncExitStack() as stack:
            stack.enter_context(threads_of_the_pool_inline())
            pupils = []
            for i, fault in enumerate([faults(dice, i) for i in range(robots)]):
                key = {"wrong key": ClassKey("w" * 40), "no class": None}.get(fault, KEY)
                pupil = Pupil(clock, 9000 + i, key)
                break_down(pupil, fault)
                pupils.append(await stack.enter_async_context(pupil))
            world = ClassWorld(clock, pupils, seed)
            stack.push_async_callback(world.board.close)
            if is_told:
                for pupil in pupils:
                    world.board.add(RobotAddress("127.0.0.1", pupil.port))
            await scenario(world)

    def start(scenario: Any, seed: int = 1) -> None:
        clock = VirtualClock(100.0)
        clock.run(run(scenario, clock, seed))

    return lambda test: with_first_argument(start, test)


def break_down(pupil: Pupil, fault: str) -> None:
    """Give a robot's network a fault, or remove the fault with `none`; this also affects open
    connections."""
    pupil.fault = fault
    pupil.link.conditions = LinkConditions(
        is_silent=fault in ("silent", "gone"),
        delay_s=0.06 if fault == "slow" else 0.0,
        jitter_s=0.04 if fault == "slow" else 0.0,
    )
