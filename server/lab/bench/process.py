"""Processes that a benchmark asks: a line on standard input is answered with one of JSON."""

from __future__ import annotations

import contextlib
import http.client
import json
import os
import subprocess
import sys
from collections.abc import Callable
from typing import Any, NoReturn, Self

from robot.errors import ConfigurationError


class BenchProcess:
    """A module of this package in a process of its own.

    Attributes:
        first: What it said when it was ready.
    """

    def __init__(self, module: str, *words: object) -> None:
        command = [sys.executable, "-m", f"server.lab.bench.{module}", *map(str, words)]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.first: Any = self._read()

    @property
    def pid(self) -> int:
        return self._process.pid

    def ask(self, word: str = "") -> Any:
        assert self._process.stdin is not None
        self._process.stdin.write(f"{word}\n")
        self._process.stdin.flush()
        return self._read()

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


class ServerUnderTest(BenchProcess):
    """A server of one of the kinds in `subject`."""

    def __init__(self, kind: str, rate_hz: float, width: int = 160, height: int = 120) -> None:
        super().__init__("subject", kind, rate_hz, width, height)
        self.port: int = self.first

    def pair(self, role: str) -> str:
        """Pair a browser with a `paired` server; return its cookie."""
        words = json.dumps({"token": self.ask()["tokens"][role]})
        with contextlib.closing(http.client.HTTPConnection("127.0.0.1", self.port)) as line:
            line.request("POST", "/api/pair", words, {"content-type": "application/json"})
            return str(line.getresponse().headers["set-cookie"]).partition(";")[0]


def answer_all(first: Any, answer: Callable[[str], Any]) -> NoReturn:
    """Say that all is ready, and answer until standard input ends; then end at once."""
    print(json.dumps(first), flush=True)
    for line in sys.stdin:
        print(json.dumps(answer(line.strip())), flush=True)
    os._exit(0)
