"""A server to be measured, in a separate process."""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import gc
import http.client
import json
import multiprocessing
import os
import sys
import tempfile
import threading
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Self

from robot.clock import RealClock
from robot.devices.rig import Rig
from robot.errors import ConfigurationError
from robot.policy.registry import make_policy
from robot.store.folder import Storage
from robot.testing import FakeCamera, FakeDriver
from server.access.config import NetworkLimits
from server.app import create_app
from server.clients.video import VideoHub
from server.config import Config
from server.hosting.serving import leave_out_of_collections
from server.lab.bench.peer import serve_plain
from server.lab.served import served
from server.persistence import Persistence
from server.services import Services

_COUNTED = ("serving_s", "process_s", "frames", "late_cycles", "stops")


class ServerUnderTest:
    """A server in a separate process, driven by commands through a pipe.

    Args:
        kind: `drivelesson`, or `paired` for a server that also has pairing, its limits and a data
            folder. A number starts the plain server of `peer.py` instead, and is the size of
            its pictures in bytes.
        rate_hz: The camera's frame rate, in Hz.
    """

    def __init__(self, kind: str | int, rate_hz: float) -> None:
        spawning = multiprocessing.get_context("spawn")
        self._line, other_end = spawning.Pipe()
        serving = serve_plain if isinstance(kind, int) else _serve
        self._process = spawning.Process(target=serving, args=(other_end, kind, rate_hz))
        self._process.start()
        other_end.close()
        self.port: int = self._read()

    @property
    def pid(self) -> int:
        assert self._process.pid is not None
        return self._process.pid

    def ask(self, word: str = "") -> Any:
        """Return the server's measurements: the CPU times of the process and of its serving thread,
        and the counts and times of the control loop and the body. If the word is `forget`, the
        process first deletes all training and notes. The answer then also contains the memory in
        use."""
        self._line.send(word)
        return self._read()

    async def watch(self, seconds: float) -> dict[str, Any]:
        """Return the server's measurements over the next `seconds`, and the time at which they
        began."""
        before, start_s = self.ask(), time.monotonic()
        await asyncio.sleep(seconds)
        after, lasted_s = self.ask(), time.monotonic() - start_s
        spent = {name: after[name] - before[name] for name in _COUNTED}
        ticked_s = [at_s for at_s in after["ticked_s"] if at_s >= start_s]
        since = {"start_s": start_s, "lasted_s": lasted_s, "ticked_s": ticked_s}
        return {**spent, **since, "bytes": after.get("bytes")}

    def pair(self, role: str) -> str:
        """Pair a browser with a `paired` server; return its cookie."""
        words = json.dumps({"token": self.ask()["tokens"][role]})
        with contextlib.closing(http.client.HTTPConnection("127.0.0.1", self.port)) as line:
            line.request("POST", "/api/pair", words, {"content-type": "application/json"})
            return str(line.getresponse().headers["set-cookie"]).partition(";")[0]

    def _read(self) -> Any:
        try:
            return self._line.recv()
        except EOFError:
            raise ConfigurationError(
                "the measured server has ended; its error is shown above"
            ) from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self._line.close()
        self._process.join(60)
        if self._process.is_alive():
            self._process.kill()
            raise ConfigurationError("the measured server had not ended after 60 s and was killed")


def _serve(line: Connection, kind: str, rate_hz: float) -> None:
    """Send the port of the server through the pipe; answer commands until the pipe is closed."""
    config = Config(port=0, limits=NetworkLimits(requests_burst=1e9))
    driver, camera = FakeDriver(), FakeCamera(RealClock(), rate_hz)
    rig = Rig(driver, camera, make_policy(), camera.clock)
    ticked_s: list[float] = []
    rig.loop.subscribe(lambda tick: ticked_s.append(tick.now_s) if tick.frame else None)
    with contextlib.suppress(EOFError), contextlib.ExitStack() as stack:
        more: dict[str, Any] = {}
        if kind == "paired":
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            from server.access.config import NetworkConfig
            from server.access.gateway import NetworkGateway
            from server.access.pairing import Pairing

            config = NetworkConfig(port=0, host="127.0.0.1", lan=True, data=folder)
            more["gateway"] = NetworkGateway(config, rig.clock, Pairing(1000))
            more["persistence"] = Persistence(Storage(folder), rig)
        services = Services(config, rig, name="bench", **more)
        pairing = getattr(services.gateway, "pairing", None)
        stack.enter_context(rig)
        if services.persistence is not None:
            services.persistence.start()
        address = stack.enter_context(served(create_app(services), config))
        leave_out_of_collections()
        line.send(int(address.rsplit(":", 1)[1]))
        while True:
            found: dict[str, Any] = {}
            if line.recv() == "forget":
                driver.changes.clear()
                ticked_s.clear()
                rig.loop.submit(lambda: rig.loop.history.replace_policy(make_policy())).result()
                found = _memory()
            state = rig.loop.state
            found |= {
                "process_s": time.process_time(),
                "serving_s": _serving_cpu_s(),
                "frames": state.frame_id,
                "cycle_hz": state.cycle_hz,
                "late_cycles": state.late_cycles,
                "changes": [(at_s, action.value) for at_s, action in driver.changes],
                "threads": threading.active_count(),
                "tasks": len(asyncio.all_tasks(services.hub.broadcast.event_loop)),
                "moved_s": driver.moved_s,
                "mode": state.decision.mode.value,
                "stop_reason": state.decision.stop_reason,
                "stops": sum(state.stops.values()),
                "ticked_s": ticked_s[-1000:],
                "bytes": _picture_bytes(services.hub.broadcast.video),
                "tokens": {r.value: t for r, t in pairing.tokens.items()} if pairing else {},
            }
            line.send(found)


def _picture_bytes(video: VideoHub) -> int:
    """Return the size of the newest picture as viewers get it; 0 without viewers."""
    return len(video.encoder.encode(video.newest).data) if video.newest else 0


def _serving_cpu_s() -> float:
    """Return the CPU time of the serving thread; camera, loop and learner have other threads."""
    thread = next(thread for thread in threading.enumerate() if thread.name == "server")
    return time.clock_gettime(time.pthread_getcpuclockid(thread.ident or 0))


def _memory() -> dict[str, int]:
    """Return the number of Python's memory blocks, and the resident memory in bytes.

    Unused memory is first returned to the system. Without this, the result would include a random
    amount of unused memory that the allocator keeps.
    """
    gc.collect()
    blocks = sys.getallocatedblocks()
    with contextlib.suppress(AttributeError):  # some C libraries lack `malloc_trim`
        ctypes.CDLL(None).malloc_trim(0)
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return {"blocks": blocks, "resident_bytes": pages * os.sysconf("SC_PAGE_SIZE")}
