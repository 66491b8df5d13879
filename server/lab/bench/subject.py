"""A server to be measured, as a process: `python -m server.lab.bench.subject KIND HZ`.

It prints its port, then answers each line on standard input with one line of JSON: the CPU time
that the process and its serving thread have used, and for ours what loop and body have noted. The
line `forget` makes ours forget what it was taught and has noted first, and adds the memory in use.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import json
import os
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from robot.clock import RealClock
from robot.testing import FakeCamera, FakeDriver


def main() -> None:
    kind, rate_hz = sys.argv[1:]
    camera = FakeCamera(RealClock(), float(rate_hz))
    with tempfile.TemporaryDirectory() as folder, _serving(kind, camera, Path(folder)) as served:
        port, notes = served
        print(port, flush=True)
        for line in sys.stdin:
            used = {"process_s": time.process_time(), "serving_s": _serving_cpu_s()}
            print(json.dumps(used | notes(line.strip() == "forget")), flush=True)
        os._exit(0)


def _serving_cpu_s() -> float:
    """CPU time of the thread that serves: camera, control loop and learner are others'."""
    thread = next(thread for thread in threading.enumerate() if thread.name == "server")
    return time.clock_gettime(time.pthread_getcpuclockid(thread.ident or 0))


@contextlib.contextmanager
def _serving(kind: str, camera: FakeCamera, folder: Path) -> Iterator[tuple[int, Any]]:
    from robot.devices.rig import Rig
    from robot.policy.registry import make_policy
    from robot.store.folder import Storage
    from server.app import create_app
    from server.config import Config, Limits
    from server.hosting.serving import leave_out_of_collections, served
    from server.persistence import Persistence
    from server.security.pairing import Pairing
    from server.services import make_services

    config = Config(port=0, limits=Limits(requests_burst=1e9))
    learner = "default-32"
    rig = Rig(FakeDriver(), camera, make_policy(learner), camera.clock)
    more: dict[str, Any] = {}
    if kind == "paired":
        config = Config(port=0, host="127.0.0.1", lan=True, data=folder)
        more = {"pairing": Pairing(1000), "persistence": Persistence(Storage(folder), rig)}
    services = make_services(config, rig, name="bench", **more)
    ticked_s: list[float] = []
    rig.loop.subscribe(lambda tick: ticked_s.append(tick.now_s) if tick.frame else None)

    def notes(forget: bool) -> dict[str, Any]:
        state = rig.loop.state
        driver = rig.driver
        assert isinstance(driver, FakeDriver)
        if forget:
            driver.changes.clear()
            ticked_s.clear()
            rig.loop.submit(lambda: rig.loop.history.replace_policy(make_policy(learner))).result()
        return (_memory() if forget else {}) | {
            "frames": state.frame_id,
            "cycle_hz": state.cycle_hz,
            "cycles": state.cycles,
            "late_cycles": state.late_cycles,
            "changes": [(at_s, action.value) for at_s, action in driver.changes],
            "threads": threading.active_count(),
            "tasks": services.hub.tasks(),
            "moved_s": driver.moved_s,
            "mode": state.decision.mode.value,
            "stop_reason": state.decision.stop_reason,
            "stops": sum(state.stops.values()),
            "ticked_s": ticked_s[-1000:],
            "tokens": services.pairing.tokens if services.pairing else {},
        }

    with contextlib.ExitStack() as stack:
        stack.enter_context(rig)
        if services.persistence is not None:
            services.persistence.start()
            stack.callback(services.persistence.stop)
        address = stack.enter_context(served(create_app(services), config))
        leave_out_of_collections()
        yield int(address.rsplit(":", 1)[1]), notes


def _memory() -> dict[str, int]:
    """Return the blocks of Python's objects, and the resident bytes once free ones are given back.

    How much the allocator keeps for later is left to chance.
    """
    gc.collect()
    blocks = sys.getallocatedblocks()
    with contextlib.suppress(AttributeError):  # the C library of some systems has it not
        ctypes.CDLL(None).malloc_trim(0)
    with Path("/proc/self/statm").open(encoding="ascii") as file:
        pages = int(file.read().split()[1])
    return {"blocks": blocks, "resident_bytes": pages * os.sysconf("SC_PAGE_SIZE")}


if __name__ == "__main__":
    main()
