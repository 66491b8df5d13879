"""Serves a bench robot with pairing, in a process with few descriptors, and sends requests to
it."""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx

from robot.clock import RealClock
from robot.devices.rig import Rig
from robot.policy.registry import make_policy
from robot.testing import FakeCamera, FakeDriver
from server.access.config import NetworkConfig
from server.access.gateway import NetworkGateway
from server.access.pairing import Pairing
from server.app import create_app
from server.hosting.logs import start_logging
from server.hosting.serving import leave_out_of_collections
from server.lab.served import served
from server.services import Services
from tests.server.access.unpaired_flood import PATIENCE_S

from .live_robot import WEB

DESCRIPTORS = 1024


class Process:
    """The running server; a test can ask it for a report."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process
        self.address = str(json.loads(self._line())["address"])
        self.port = int(self.address.rsplit(":", 1)[1])

    def ask(self, command: str = "") -> dict[str, Any]:
        """Return the server's report; `release` first releases an emergency stop."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{command}\n")
        self._process.stdin.flush()
        notes: dict[str, Any] = json.loads(self._line())
        return notes

    def pair(self, role: str = "pilot") -> str:
        """Pair a browser; return its cookie."""
        token = self.ask()["tokens"][role]
        answer = httpx.post(self.address + "/api/pair", json={"token": token}, timeout=PATIENCE_S)
        assert answer.status_code == 200, answer.text
        return answer.headers["set-cookie"].split(";")[0]

    def _line(self) -> str:
        assert self._process.stdout is not None
        return self._process.stdout.readline()


@contextlib.contextmanager
def lan_process(log: Path) -> Iterator[Process]:
    """While the `with` block runs, serve; the server's log goes to a file."""
    words = [sys.executable, "-m", "tests.server.lan_process", str(WEB)]
    with log.open("w") as errors:
        process = subprocess.Popen(
            words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, text=True
        )
        try:
            yield Process(process)
        finally:
            process.communicate(timeout=100)


def main(web: str) -> None:
    """Serve until standard input ends; each line of input is answered by a line of notes."""
    import resource  # not on Windows

    resource.setrlimit(resource.RLIMIT_NOFILE, (DESCRIPTORS, DESCRIPTORS))
    start_logging(verbose=False)
    config = NetworkConfig(port=0, web=Path(web), lan=True, host="127.0.0.1")
    pairing = Pairing(10)
    clock = RealClock()
    rig = Rig(FakeDriver(), FakeCamera(clock), make_policy("published-8"), clock)
    gateway = NetworkGateway(config, rig.clock, pairing)
    services = Services(config, rig, name="bench", gateway=gateway)
    with rig, served(create_app(services), config) as address:
        leave_out_of_collections()
        print(json.dumps({"address": address}), flush=True)
        for command in sys.stdin:
            if command.strip() == "release":
                rig.loop.release_emergency()
                while rig.loop.state.emergency:
                    clock.sleep(0.001)
            admission = gateway.admission
            notes = {
                "tokens": {role.value: token for role, token in pairing.tokens.items()},
                "open": len(admission.connections),
                "evicted": admission.pending.evicted + admission.admitted.evicted,
                "emergency": rig.loop.state.emergency,
            }
            print(json.dumps(notes), flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
