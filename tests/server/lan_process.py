"""Serves a bench robot with pairing in a separate process, which has few file descriptors."""

import contextlib
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx

from server.access.config import NetworkConfig
from server.access.pairing import Pairing
from server.hosting.logs import start_logging
from server.hosting.serving import leave_out_of_collections
from tests.kit.wait import wait_until
from tests.server.access.floods import PATIENCE_S

from .live_robot import WEB, live_server

DESCRIPTORS = 1024


class Process:
    """A running server, which a test can ask for a report."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process
        self.address = str(json.loads(self._line())["address"])
        self.port = int(self.address.rsplit(":", 1)[1])
        self.drive_url = f"ws://127.0.0.1:{self.port}/ws/drive"

    def ask(self, command: str = "") -> dict[str, Any]:
        """Return the server's report; `release` first releases an emergency stop."""
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
    """Serve until standard input ends; answer each line of input with a report in JSON."""
    import resource  # not on Windows

    resource.setrlimit(resource.RLIMIT_NOFILE, (DESCRIPTORS, DESCRIPTORS))
    start_logging(verbose=False)
    config = NetworkConfig(port=0, web=Path(web), lan=True, host="127.0.0.1")
    pairing = Pairing(10)
    with live_server(config, pairing=pairing) as server:
        admission, loop = server.services.gateway.admission, server.rig.loop
        leave_out_of_collections()
        print(json.dumps({"address": server.address}), flush=True)
        for command in sys.stdin:
            if command.strip() == "release":
                loop.release_emergency()
                wait_until(lambda: not loop.state.emergency)
            notes = {
                "tokens": {role.value: token for role, token in pairing.tokens.items()},
                "open": len(admission.connections),
                "evicted": admission.pending.evicted + admission.admitted.evicted,
                "emergency": loop.state.emergency,
            }
            print(json.dumps(notes), flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
