"""A server to be measured, as a process: `python -m server.lab.bench.subject KIND HZ`.

It prints its port, then answers each line on standard input with one line of JSON: the CPU time
that the process and its serving thread have used, and what loop and body have noted. The line
`forget` makes it forget what it was taught and has noted first, and adds the memory in use.
"""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import gc
import json
import os
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

from robot.clock import RealClock
from robot.devices.rig import Rig
from robot.policy.registry import make_policy
from robot.store.folder import Storage
from robot.testing import FakeCamera, FakeDriver
from server.app import create_app
from server.config import Config, Limits
from server.hosting.serving import leave_out_of_collections, served
from server.persistence import Persistence
from server.security.pairing import Pairing
from server.services import make_services


def main() -> None:
    kind, rate_hz = sys.argv[1:]
    config = Config(port=0, limits=Limits(requests_burst=1e9))
    driver, camera = FakeDriver(), FakeCamera(RealClock(), float(rate_hz))
    rig = Rig(driver, camera, make_policy(), camera.clock)
    ticked_s: list[float] = []
    rig.loop.subscribe(lambda tick: ticked_s.append(tick.now_s) if tick.frame else None)
    with contextlib.ExitStack() as stack:
        more: dict[str, Any] = {}
        if kind == "paired":
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            config = Config(port=0, host="127.0.0.1", lan=True, data=folder)
            more = {"pairing": Pairing(1000), "persistence": Persistence(Storage(folder), rig)}
        services = make_services(config, rig, name="bench", **more)
        stack.enter_context(rig)
        if services.persistence is not None:
            services.persistence.start()
        address = stack.enter_context(served(create_app(services), config))
        leave_out_of_collections()
        print(address.rsplit(":", 1)[1], flush=True)
        for line in sys.stdin:
            found: dict[str, Any] = {}
            if line.strip() == "forget":
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
                "tasks": len(asyncio.all_tasks(services.hub.event_loop)),
                "moved_s": driver.moved_s,
                "mode": state.decision.mode.value,
                "stop_reason": state.decision.stop_reason,
                "stops": sum(state.stops.values()),
                "ticked_s": ticked_s[-1000:],
                "tokens": services.pairing.tokens if services.pairing else {},
            }
            print(json.dumps(found), flush=True)
        os._exit(0)


def _serving_cpu_s() -> float:
    """CPU time of the thread that serves: camera, control loop and learner are others'."""
    thread = next(thread for thread in threading.enumerate() if thread.name == "server")
    return time.clock_gettime(time.pthread_getcpuclockid(thread.ident or 0))


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
