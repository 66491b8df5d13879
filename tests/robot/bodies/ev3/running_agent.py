"""The agent's archive in a separate process, as a brick runs it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Self

from robot.bodies.ev3.archive import make_agent

SECRET = "a shared secret"


class RunningAgent:
    """A context manager; `address` is the address at which it listens."""

    def __init__(
        self, root: Path, folder: Path, env: dict[str, str] | None = None, port: str = "0"
    ) -> None:
        secret = folder / "secret"
        secret.write_text(SECRET)
        secret.chmod(0o600)
        archive = folder / "agent.pyz"
        archive.write_bytes(make_agent())
        words = [archive, "--host", "127.0.0.1", "--port", port]
        words += ["--secret-file", secret, "--root", root]
        self.process = subprocess.Popen(
            [sys.executable, *map(str, words)], stdout=subprocess.PIPE, text=True, env=env
        )
        assert self.process.stdout is not None
        self.address = "127.0.0.1:" + self.process.stdout.readline().split()[-1]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.process.terminate()
        self.process.wait(60)
        assert self.process.stdout is not None
        self.process.stdout.close()
