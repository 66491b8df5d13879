"""A bench robot served with pairing, in a process with few descriptors: for test_strangers."""

from __future__ import annotations

import json
import resource
import sys
import threading
from pathlib import Path

from robot.clock import RealClock
from robot.devices.rig import Rig
from robot.policy.registry import make_policy
from robot.testing import FakeCamera, FakeDriver
from server.app import create_app
from server.config import Config
from server.hosting.logs import start_logging
from server.hosting.serving import served
from server.security.pairing import Pairing
from server.services import make_services

DESCRIPTORS = 1024


def main(web: str) -> None:
    """Serve until standard input ends; each line of it is answered by one of notes."""
    resource.setrlimit(resource.RLIMIT_NOFILE, (DESCRIPTORS, DESCRIPTORS))
    start_logging(verbose=False)
    config = Config(port=0, web=Path(web), lan=True, host="127.0.0.1")
    pairing = Pairing(config.limits.pairing_failures)
    clock = RealClock()
    rig = Rig(FakeDriver(), FakeCamera(clock), make_policy("published-8"), clock)
    services = make_services(config, rig, name="bench", pairing=pairing)
    with rig, served(create_app(services), config) as address:
        notes = {"address": address, "threads": threading.active_count()}
        print(json.dumps(notes), flush=True)
        for _ in sys.stdin:
            tokens = {role.value: token for role, token in pairing.tokens.items()}
            driver = rig.driver
            assert isinstance(driver, FakeDriver)
            stood_s = [
                after - at
                for (at, action), (after, _) in zip(
                    driver.changes, driver.changes[1:], strict=False
                )
                if action.value == "stop"
            ]
            print(
                json.dumps(
                    {
                        "tokens": tokens,
                        "open": services.door.open,
                        "evicted": services.door.evicted,
                        "longest_stand_s": max(stood_s[1:], default=0.0),
                        "moves": sum(one.value != "stop" for _, one in driver.changes),
                        "mode": rig.loop.state.decision.mode.value,
                        "stops": sum(rig.loop.state.stops.values()),
                    }
                ),
                flush=True,
            )


if __name__ == "__main__":
    main(sys.argv[1])
