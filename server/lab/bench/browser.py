"""A Chromium, driven over the DevTools protocol."""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from robot.errors import ConfigurationError

_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chromium-headless-shell")
_FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--mute-audio",
    "--remote-debugging-port=0",
    "--window-size=390,844",
)
_PATIENCE_S = 30.0
STATE = "document.querySelector('drive-pad').page.store.state"
"""What the page knows, as JavaScript."""


class DevToolsPage:
    """One tab, driven over the DevTools protocol."""

    def __init__(self, socket: Any) -> None:
        self._socket = socket
        self._ids = itertools.count(1)
        self._session: str | None = None
        target = self.send("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.send("Target.attachToTarget", targetId=target, flatten=True)[
            "sessionId"
        ]
        self.send("Performance.enable", timeDomain="threadTicks")
        self.send(
            "Emulation.setDeviceMetricsOverride",
            width=390,
            height=844,
            deviceScaleFactor=2,
            mobile=True,
        )
        self.send("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=5)

    def send(self, method: str, **params: Any) -> dict[str, Any]:
        number = next(self._ids)
        session = {"sessionId": self._session} if self._session else {}
        self._socket.send(json.dumps({"id": number, "method": method, "params": params, **session}))
        while True:
            answer = json.loads(self._socket.recv(timeout=_PATIENCE_S))
            if answer.get("id") == number:
                if "error" in answer:
                    raise ConfigurationError(f"Chromium refused {method}: {answer['error']}")
                result: dict[str, Any] = answer["result"]
                return result

    def evaluate(self, expression: str) -> Any:
        """Return what an expression comes to on the page."""
        answer = self.send("Runtime.evaluate", expression=expression, returnByValue=True)
        return answer["result"].get("value")

    def wait_for(self, expression: str, within_s: float = _PATIENCE_S) -> None:
        deadline_s = time.monotonic() + within_s
        while not self.evaluate(expression):
            if time.monotonic() > deadline_s:
                raise ConfigurationError(f"the page never came to {expression}")
            time.sleep(0.05)

    def middle_of(self, selector: str) -> dict[str, float]:
        """Return where a finger or a mouse meets an element."""
        found = f"document.querySelector('{selector}').getBoundingClientRect()"
        box = json.loads(self.evaluate(f"JSON.stringify({found})"))
        return {"x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2}

    def open(self, address: str) -> None:
        """Go to an address, and wait for the first picture."""
        self.send("Page.navigate", url=address)
        self.wait_for("Boolean(document.querySelector('video-view')?.dataset.frames)")

    def metrics(self) -> dict[str, float]:
        """Return Chromium's counters of this page's main thread, in seconds of its CPU time: what
        else the machine does is not in them."""
        rows = self.send("Performance.getMetrics")["metrics"]
        return {row["name"]: row["value"] for row in rows}

    def processes_cpu_s(self) -> float:
        """Return the CPU time of all of Chromium's processes together."""
        session, self._session = self._session, None  # the browser knows, not the tab
        try:
            rows = self.send("SystemInfo.getProcessInfo")["processInfo"]
        finally:
            self._session = session
        return float(sum(row["cpuTime"] for row in rows))

    def start_and_hold(self) -> None:
        """Choose to teach, and hold Forward with one finger."""
        deadline_s = time.monotonic() + _PATIENCE_S
        while self.evaluate(f"{STATE}.robot?.mode") != "train":
            if time.monotonic() > deadline_s:
                raise ConfigurationError("the robot does not start")
            self.evaluate("document.querySelector('mode-bar [data-mode=train]').click()")
            time.sleep(0.3)
        point = self.middle_of(".move[data-move=forward]")
        self.send("Input.dispatchTouchEvent", type="touchStart", touchPoints=[point])

    def release(self) -> None:
        self.send("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])


@contextlib.contextmanager
def running_browser() -> Iterator[DevToolsPage]:
    """Run a Chromium with a fresh profile while the block runs."""
    from websockets.sync.client import connect

    path = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, _BROWSERS)), None)
    if path is None:
        raise ConfigurationError(
            "no Chromium was found: install chromium, or name it in the environment as CHROMIUM"
        )
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        process = subprocess.Popen(
            [path, *_FLAGS, f"--user-data-dir={profile}", "about:blank"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            port, path = _wait_for_port(Path(profile) / "DevToolsActivePort", process)
            with connect(f"ws://127.0.0.1:{port}{path}", compression=None, max_size=None) as socket:
                yield DevToolsPage(socket)
        finally:
            process.terminate()
            process.wait(10)


def _wait_for_port(file: Path, process: subprocess.Popen[bytes]) -> tuple[int, str]:
    deadline_s = time.monotonic() + _PATIENCE_S
    while time.monotonic() < deadline_s and process.poll() is None:
        with contextlib.suppress(OSError, ValueError):
            port, path = file.read_text().splitlines()[:2]
            return int(port), path
        time.sleep(0.05)
    raise ConfigurationError("Chromium did not start, or does not say where it listens")
