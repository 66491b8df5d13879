"""A class on this machine: the real servers of robots, and a real board."""

from __future__ import annotations

import contextlib
import datetime as dt
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from robot.clock import RealClock
from robot.devices.rig import Rig, build_rig
from robot.policy.registry import make_policy
from robot.store.folder import Storage
from robot.testing import FakeCamera, FakeDriver
from server.access.certificates import make_certificates
from server.access.config import NetworkConfig
from server.access.gateway import NetworkGateway
from server.access.pairing import Pairing
from server.app import create_app
from server.board.app import create_board_app
from server.board.board import Board
from server.board.class_key import ClassKey
from server.board.classroom import Classroom
from server.board.transport import NetworkTransport, RobotAddress
from server.clients.hub import Hub
from server.config import Config
from server.identity import COLOURS, IdentityFile
from server.lab.served import served
from server.persistence import Persistence
from server.services import Services
from tests.kit.ports import free_port

KEY = ClassKey("k" * 40)
NAMES = ("Ada", "Bolt", "Comet", "Dot", "Echo", "Fox", "Gizmo", "Hazel", "Indigo", "Juno")


@dataclass
class LiveClass:
    """A board and its address, and the services of each of its robots."""

    address: str
    board: Board
    robots: list[Services]


@contextlib.contextmanager
def running_class(
    folder: Path, robots: int = 3, away: int = 0, *, simulated: bool = False, tls: int = 0
) -> Iterator[LiveClass]:
    """Serve this number of robots and a board, which also lists `away` robots that do not answer.

    The first `tls` robots are served over https.
    """
    with contextlib.ExitStack() as stack:
        found, addresses = [], []
        for i in range(robots):
            clock = RealClock()
            rig = (
                _simulated(i)
                if simulated
                else Rig(FakeDriver(), FakeCamera(clock, 4.0), make_policy("published-8"), clock)
            )
            data = folder / f"robot-{i}"
            identity = IdentityFile(data, NAMES[i % len(NAMES)])
            identity.change(colour=COLOURS[i % len(COLOURS)])
            persistence = Persistence(Storage(data), rig, name=identity.now.name)
            config = NetworkConfig(port=0, data=data, tls=i < tls)
            gateway = NetworkGateway(config, rig.clock, Pairing(10))
            if config.tls:
                now = dt.datetime.now(dt.UTC)
                made = make_certificates(data / "tls", ["127.0.0.1"], now)
                gateway.tls_files = str(made.key), str(made.chain)
            services = Services(
                config,
                rig,
                hub=Hub(config, rig, identity),
                persistence=persistence,
                gateway=gateway,
                options={"classroom": Classroom(KEY, data / "class.json")},
            )
            stack.enter_context(rig)
            stack.enter_context(persistence)
            address = stack.enter_context(served(create_app(services), config))
            addresses.append(RobotAddress.parse(address))
            found.append(services)
        addresses += [RobotAddress("127.0.0.1", free_port()) for _ in range(away)]
        clock = RealClock()
        board = Board(KEY, NetworkTransport(), clock)

        def begin() -> None:
            for one in addresses:
                board.add(one)

        config = Config(port=0, data=folder)
        address = stack.enter_context(served(create_board_app(config, board, clock, begin), config))
        yield LiveClass(address, board, found)


def _simulated(number: int) -> Rig:
    worlds = ("box", "office")
    options = {"world": worlds[number % 2], "seed": str(number), "frame_rate_hz": "5"}
    return build_rig("sim", options=options)
