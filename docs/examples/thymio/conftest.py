"""Simulates a device manager with a Thymio on this machine, with tdmclient's server classes."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager

from drivelesson_thymio import ThymioDriver, ThymioOptions
from tdmclient.server import ServerHandler, ServerNode

from robot.testing.cases import DriverCase
from robot.types import Point

AT_REST = {"motor.left.target": [0], "motor.right.target": [0]}


class Manager:
    """Serves one Thymio, whose motors keep their targets; drops all messages while `is_cut`."""

    def __init__(self) -> None:
        self.node = ServerNode(name="Anna", variables=dict(AT_REST))
        self.is_cut = False
        self.lines: list[socket.socket] = []
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.threads = [threading.Thread(target=self.accept)]
        self.threads[0].start()

    @property
    def address(self) -> str:
        return f"127.0.0.1:{self.listener.getsockname()[1]}"

    def drives(self) -> Point:
        left, right = (self.node.variables[name][0] for name in AT_REST)
        return Point(left - right, left + right)

    def accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                line, _ = self.listener.accept()
                self.lines.append(line)
                self.threads.append(threading.Thread(target=self.serve, args=(line,)))
                self.threads[-1].start()

    def serve(self, line: socket.socket) -> None:
        def send(packet: bytes) -> None:
            line.sendall(len(packet).to_bytes(4, "little") + packet)

        handler = ServerHandler(None, {self.node}, send)
        with contextlib.suppress(OSError), line, line.makefile("rb") as file:
            while head := file.read(4):
                packet = file.read(int.from_bytes(head, "little"))
                if not self.is_cut:
                    handler.process_message(packet)

    def cut(self) -> None:
        """Cut the connection, as if the manager, its computer or the robot had failed."""
        self.is_cut = True
        self.node.variables = dict(AT_REST)  # a Thymio stops when it loses its dongle
        self.node.status = 2

    def mend(self) -> None:
        self.is_cut = False

    def end(self) -> None:
        for each in (self.listener, *self.lines):
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
        self.listener.close()
        for thread in self.threads:
            thread.join()


@contextmanager
def stand_in() -> Iterator[DriverCase]:
    manager = Manager()
    driver = ThymioDriver(ThymioOptions(thymio_manager=manager.address))
    try:
        yield DriverCase(
            driver,
            time.sleep,
            lambda: manager.drives() != Point(0.0, 0.0),
            manager.cut,
            restore_link=manager.mend,
            drives=manager.drives,
        )
    finally:
        manager.mend()
        driver.disconnect()
        manager.end()


def pytest_drivelesson_driver(name: str) -> AbstractContextManager[DriverCase] | None:
    return stand_in() if name == "thymio" else None
