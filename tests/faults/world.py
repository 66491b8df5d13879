"""A pilot drives a bench robot through a link whose weather can be made."""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from collections.abc import Callable, Coroutine, Iterator
from dataclasses import dataclass
from typing import Any

from robot.clock import RealClock
from robot.types import Action
from server.bench.proxy import LinkConditions, Proxy
from server.bench.robot import SteadyCamera
from tests.server.live_robot import LiveServer, Pilot, live_server, wait_until


class JumpingClock(RealClock):
    """The machine's clock, which can be made to jump ahead."""

    def __init__(self) -> None:
        self.ahead_s = 0.0

    def now_s(self) -> float:
        return super().now_s() + self.ahead_s


@dataclass
class World:
    """One robot behind one bad link."""

    server: LiveServer
    proxy: Proxy
    clock: JumpingClock
    pilot: Pilot

    @property
    def conditions(self) -> LinkConditions:
        return self.proxy.conditions

    def stands(self) -> bool:
        return self.server.driver.now is Action.STOP

    @property
    def last_word_s(self) -> float:
        """When the server last heard a word of the pilot (time.monotonic)."""
        pages = list(self.server.hub.pages.values())
        return max((page.last_word_s for page in pages), default=0.0)

    def start(self, mode: str) -> None:
        """Have the robot drive: by hand, by hand in autonomous, or by itself."""
        pilot, driver = self.pilot, self.server.driver
        pilot.wait_for_state(you_are_pilot=True)
        pilot.mode("train" if mode == "train" else "autonomous")
        if mode == "autonomous":
            wait_until(lambda: driver.now is not Action.STOP, what="it drives by itself")
        else:
            pilot.wait_for_state(mode="train" if mode == "train" else "autonomous")
            pilot.hold("left")
            wait_until(lambda: driver.now is Action.LEFT, what="it is driven")
        time.sleep(0.05)


@contextlib.contextmanager
def running_world() -> Iterator[tuple[LiveServer, Proxy, JumpingClock]]:
    clock = JumpingClock()
    with live_server(camera=SteadyCamera(clock)) as server, _proxied(server.port) as proxy:
        with Pilot(server.ws("/ws/drive")) as teacher:
            teacher.mode("train")
            teacher.hold("forward")
            wait_until(lambda: sum(server.rig.loop.state.taught.values()) > 15)
        yield server, proxy, clock


@contextlib.contextmanager
def world_of(server: LiveServer, proxy: Proxy, clock: JumpingClock) -> Iterator[World]:
    proxy.conditions = LinkConditions()
    with Pilot(f"ws://127.0.0.1:{proxy.port}/ws/drive", sees=True) as pilot:
        yield World(server, proxy, clock, pilot)
    wait_until(lambda: not server.hub.pages)


@contextlib.contextmanager
def _proxied(port: int) -> Iterator[Proxy]:
    """Run a proxy on an event loop of its own."""
    event_loop = asyncio.new_event_loop()
    thread = threading.Thread(target=event_loop.run_forever, name="proxy")
    thread.start()

    def run(coroutine: Coroutine[Any, Any, None]) -> None:
        asyncio.run_coroutine_threadsafe(coroutine, event_loop).result(5)

    proxy = Proxy(port)
    run(proxy.start())
    try:
        yield proxy
    finally:
        run(proxy.stop())
        event_loop.call_soon_threadsafe(event_loop.stop)
        thread.join()
        event_loop.close()


Change = Callable[[World], None]
Condition = Callable[[World], bool]
