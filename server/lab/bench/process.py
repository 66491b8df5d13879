"""The server of `subject` in a process of its own: a line to it is answered with one of JSON."""

from __future__ import annotations

import asyncio
import contextlib
import http.client
import json
import subprocess
import sys
import time
from typing import Any, Self

from robot.errors import ConfigurationError

_COUNTED = ("serving_s", "process_s", "frames", "late_cycles", "stops")


class ServerUnderTest:
    """A server of the kind `drivelesson`, or `paired`: with pairing, its limits and a folder."""

    def __init__(self, kind: str, rate_hz: float) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "server.lab.bench.subject", kind, str(rate_hz)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.port: int = self._read()

    @property
    def pid(self) -> int:
        return self._process.pid

    def ask(self, word: str = "") -> Any:
        assert self._process.stdin is not None
        self._process.stdin.write(f"{word}\n")
        self._process.stdin.flush()
        return self._read()

    async def watch(self, seconds: float) -> dict[str, Any]:
        """Let it serve for so long; return what it used and noted meanwhile, and since when."""
        before, start_s = self.ask(), time.monotonic()
        await asyncio.sleep(seconds)
        after, lasted_s = self.ask(), time.monotonic() - start_s
        spent = {name: after[name] - before[name] for name in _COUNTED}
        ticked_s = [at_s for at_s in after["ticked_s"] if at_s >= start_s]
        return {**spent, "start_s": start_s, "lasted_s": lasted_s, "ticked_s": ticked_s}

    def pair(self, role: str) -> str:
        """Pair a browser with a `paired` server; return its cookie."""
        words = json.dumps({"token": self.ask()["tokens"][role]})
        with contextlib.closing(http.client.HTTPConnection("127.0.0.1", self.port)) as line:
            line.request("POST", "/api/pair", words, {"content-type": "application/json"})
            return str(line.getresponse().headers["set-cookie"]).partition(";")[0]

    def _read(self) -> Any:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise ConfigurationError("a process of the benchmark ended; see above")
        return json.loads(line)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self._process.communicate(timeout=60)
