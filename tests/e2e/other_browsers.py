"""Firefox over WebDriver BiDi and WebKit over WebDriver, without a library in between.

Firefox itself accepts connections; WebKit is Debian's `webkit2gtk-driver`, whose browser needs a
display (`xvfb`). Both browsers accept W3C WebDriver actions, so tests press both in the same way.
"""

from __future__ import annotations

import contextlib
import http.client
import itertools
import json
import os
import re
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol

from tests.kit.ports import free_port

PATIENCE_S = 60.0


class OtherBrowser(Protocol):
    """One open page."""

    name: str

    def goto(self, url: str) -> None:
        """Open an address."""

    def evaluate(self, expression: str) -> Any:
        """Return the value of an expression; a string, number, boolean or null."""

    def perform(self, actions: list[dict[str, Any]]) -> None:
        """Have the fingers carry out actions, in the form that WebDriver describes."""


def missing(name: str) -> str | None:
    """Return the package to install for a browser; None if everything is installed."""
    needed = {"firefox": ("firefox-esr",), "webkit": ("WebKitWebDriver", "Xvfb")}[name]
    packages = {"WebKitWebDriver": "webkit2gtk-driver", "Xvfb": "xvfb"}
    lacking = [packages.get(one, one) for one in needed if shutil.which(one) is None]
    return f"apt-get install {' '.join(lacking)}" if lacking else None


@contextlib.contextmanager
def running(name: str) -> Iterator[OtherBrowser]:
    """Start a browser with a fresh profile, and end it."""
    with _firefox() if name == "firefox" else _webkit() as browser:
        yield browser


class _Firefox:
    name = "firefox"

    def __init__(self, socket: Any) -> None:
        self._socket = socket
        self._ids = itertools.count(1)
        self._send("session.new", {"capabilities": {}})
        self._page = self._send("browsingContext.create", {"type": "tab"})["context"]

    def _send(self, method: str, params: dict[str, Any]) -> Any:
        number = next(self._ids)
        self._socket.send(json.dumps({"id": number, "method": method, "params": params}))
        while True:
            answer = json.loads(self._socket.recv(timeout=PATIENCE_S))
            if answer.get("id") == number:
                assert answer["type"] == "success", answer
                return answer["result"]

    def goto(self, url: str) -> None:
        self._send("browsingContext.navigate", {"context": self._page, "url": url, "wait": "none"})

    def evaluate(self, expression: str) -> Any:
        answer = self._send(
            "script.evaluate",
            {
                "expression": expression,
                "target": {"context": self._page},
                "awaitPromise": False,
            },
        )
        assert answer["type"] == "success", answer
        return answer["result"].get("value")

    def perform(self, actions: list[dict[str, Any]]) -> None:
        self._send("input.performActions", {"context": self._page, "actions": actions})


@contextlib.contextmanager
def _firefox() -> Iterator[OtherBrowser]:
    from websockets.sync.client import connect

    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        words = ["firefox-esr", "--headless", "--no-remote", "--profile", profile]
        log = Path(profile) / "said"
        with log.open("w") as said:
            process = subprocess.Popen(
                [*words, "--remote-debugging-port", "0", "about:blank"],
                stdout=said,
                stderr=said,
                env={**os.environ, "HOME": profile, "MOZ_DISABLE_CONTENT_SANDBOX": "1"},
            )
        try:
            found = _wait_for(
                lambda: re.search(r"WebDriver BiDi listening on (ws://\S+)", log.read_text()),
                process,
            )
            with connect(f"{found[1]}/session", compression=None, max_size=None) as line:
                yield _Firefox(line)
        finally:
            process.terminate()
            process.wait(20)


class _WebKit:
    name = "webkit"

    def __init__(self, port: int, browser: str) -> None:
        self._port = port
        options = {"binary": browser, "args": ["--automation"]}
        wanted = {"capabilities": {"alwaysMatch": {"webkitgtk:browserOptions": options}}}
        self._path = f"/session/{self._send('POST', '/session', wanted)['sessionId']}"

    def _send(self, method: str, path: str, body: Any = None) -> Any:
        line = http.client.HTTPConnection("127.0.0.1", self._port, timeout=PATIENCE_S)
        with contextlib.closing(line):
            line.request(method, path, None if body is None else json.dumps(body))
            answer = line.getresponse()
            value = json.loads(answer.read())["value"]
            assert answer.status == 200, value
            return value

    def goto(self, url: str) -> None:
        self._send("POST", f"{self._path}/url", {"url": url})

    def evaluate(self, expression: str) -> Any:
        script = {"script": f"return ({expression})", "args": []}
        return self._send("POST", f"{self._path}/execute/sync", script)

    def perform(self, actions: list[dict[str, Any]]) -> None:
        self._send("POST", f"{self._path}/actions", {"actions": actions})

    def end(self) -> None:
        self._send("DELETE", self._path)


@contextlib.contextmanager
def _webkit() -> Iterator[OtherBrowser]:
    [browser, *_] = sorted(Path("/usr/lib").glob("*/webkit2gtk-4.*/MiniBrowser"), reverse=True)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as home, _display() as display:
        port = free_port()
        environment = {
            **os.environ,
            "DISPLAY": display,
            "HOME": home,
            "GDK_BACKEND": "x11",
            "WEBKIT_DISABLE_COMPOSITING_MODE": "1",
            "LIBGL_ALWAYS_SOFTWARE": "1",
            "NO_AT_BRIDGE": "1",
        }
        process = subprocess.Popen(
            ["WebKitWebDriver", f"--port={port}"], env=environment, stderr=subprocess.DEVNULL
        )
        try:
            _wait_for(lambda: _answers(port), process)
            page = _WebKit(port, str(browser))
            try:
                yield page
            finally:
                with contextlib.suppress(Exception):
                    page.end()
        finally:
            process.terminate()
            process.wait(20)


@contextlib.contextmanager
def _display() -> Iterator[str]:
    """Run an X server without a screen; the server chooses its own display number."""
    reading, writing = os.pipe()
    words = ["Xvfb", "-displayfd", str(writing), "-screen", "0", "1280x1024x24", "-nolisten", "tcp"]
    process = subprocess.Popen(words, pass_fds=[writing], stderr=subprocess.DEVNULL)
    os.close(writing)
    try:
        with os.fdopen(reading) as said:
            yield f":{said.readline().strip()}"
    finally:
        process.terminate()
        process.wait(20)


def _answers(port: int) -> bool:
    with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 1):
        return True
    return False


def _wait_for(condition: Any, process: subprocess.Popen[Any]) -> Any:
    deadline_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline_s:
        if found := condition():
            return found
        assert process.poll() is None, "the browser ended"
        time.sleep(0.05)
    raise AssertionError("the browser did not start")
