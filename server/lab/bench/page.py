"""Measures how soon a phone can use the page, the load of its main thread, and the frame rates.

A Chromium opens the page and holds Forward with one finger; the server is a separate process. To
imitate a slow phone, Chromium slows down its main thread. To imitate a first visit, Chromium has a
new profile and a slow network.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import shutil
import time
from collections.abc import Iterator
from typing import Any

from robot.errors import ConfigurationError, need
from robot.study.table import Table
from server.cli.parser import number, several, whole
from server.lab.bench.report import add_usual, report
from server.lab.bench.subject import ServerUnderTest

_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chromium-headless-shell")
_FLAGS = ("--no-sandbox", "--disable-gpu", "--disable-background-networking", "--mute-audio")
LINKS: dict[str, dict[str, float]] = {
    "fast 3G": {"latency": 150, "downloadThroughput": 200_000, "uploadThroughput": 93_750},
    "DevTools' 3G": {"latency": 562.5, "downloadThroughput": 180_000, "uploadThroughput": 84_375},
}
"""Slow links, each with the latency of a request in milliseconds and the rates in bytes per second.
`DevTools' 3G` is a preset of Chromium's DevTools. DevTools delays each request only once, not each
packet, so the preset has a longer latency to make up for the difference."""
PHONE = 4
_WATCH = """window.usableMs = new Promise((done, fail) => {
  setTimeout(() => fail(new Error('a person cannot teach within 30 s')), 30000);
  (function look() {
    const sees = document.querySelector('video-view[data-frames]');
    const teach = document.querySelector('mode-bar [data-mode=train][aria-disabled=false]');
    if (sees && teach) done(performance.now());
    else requestAnimationFrame(look);
  })();
});"""
_BUSY = ("TaskDuration", "ScriptDuration", "LayoutDuration", "RecalcStyleDuration")
_PATIENCE_S = 30.0
_STATE = "document.querySelector('drive-pad').page.store.state"
"""JavaScript expression that returns the state of the page's store."""


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--throttle",
        type=several(number(above=0)),
        default="1,4,6",
        help="factor by which the phone is slower (%(default)s)",
    )
    text = "number of first visits (%(default)s)"
    parser.add_argument("--visits", type=whole(0), default=3, help=text)
    add_usual(parser, seconds=10.0)


def run(args: argparse.Namespace) -> int:
    with ServerUnderTest("drivelesson", args.rate) as subject, _phone() as page:
        page.goto(f"http://127.0.0.1:{subject.port}/")
        page.wait_for_selector("video-view[data-frames]")
        tools = page.context.new_cdp_session(page)
        # Count CPU time, because it excludes other load on the machine.
        tools.send("Performance.enable", {"timeDomain": "threadTicks"})
        rows = [_measure(page, tools, rate, args.seconds) for rate in args.throttle]
    with ServerUnderTest("drivelesson", args.rate) as subject:
        visits = [(name, *_visit(subject, name)) for name in LINKS for _ in range(args.visits)]
    lines = tuple(
        (
            f"{row['throttle']:g}",
            *(f"{row[key]:.1%}" for key in ("busy", "script", "layout")),
            *(f"{row[key]:.1f}" for key in ("painted_per_s", "learned_per_s")),
            ", ".join(row["stops"]) or "none",
        )
        for row in rows
    )
    columns = ("slower", "busy", "script", "style, layout", "painted/s", "learned/s", "stops")
    return report(
        args,
        {"busy": rows, "first_visits": visits},
        Table(title="The page's main thread", columns=columns, rows=lines),
        Table(
            title=f"First visits, on a phone {PHONE} times slower than this computer",
            columns=("link", "picture", "usable"),
            rows=tuple(
                (name, f"{seen_s:.1f} s", f"{used_s:.1f} s") for name, seen_s, used_s in visits
            ),
            note="usable: there is a picture, and Teach can be pressed.",
        ),
    )


def _visit(subject: ServerUnderTest, link: str) -> tuple[float, float]:
    """Return the seconds until a new browser shows a picture, and until a person can teach."""
    with _phone() as page:
        tools = page.context.new_cdp_session(page)
        tools.send("Network.enable")
        tools.send("Network.emulateNetworkConditions", {"offline": False, **LINKS[link]})
        tools.send("Emulation.setCPUThrottlingRate", {"rate": PHONE})
        page.add_init_script(_WATCH)
        page.goto(f"http://127.0.0.1:{subject.port}/")
        usable_ms = page.evaluate("window.usableMs")
        seen_ms = page.evaluate("performance.getEntriesByName('first-frame')[0].startTime")
        return seen_ms / 1000, usable_ms / 1000


@contextlib.contextmanager
def _phone() -> Iterator[Any]:
    """While the `with` block runs, run Chromium as a phone's browser; yield its page."""
    playwright = need("playwright.sync_api", "the benchmark of the page", "dev")
    path = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, _BROWSERS)), None)
    if path is None:
        raise ConfigurationError(
            "no Chromium was found: install chromium, or name it in the environment as CHROMIUM"
        )
    with playwright.sync_playwright() as running:
        browser = running.chromium.launch(executable_path=path, args=list(_FLAGS))
        yield browser.new_page(
            viewport={"width": 390, "height": 844},
            device_scale_factor=2,
            is_mobile=True,
            has_touch=True,
        )
        browser.close()


def _measure(page: Any, tools: Any, throttle: float, seconds: float) -> dict[str, Any]:
    tools.send("Emulation.setCPUThrottlingRate", {"rate": throttle})
    _start_and_hold(page, tools)
    time.sleep(2.0)
    before, learned, painted, start_s = _metrics(tools), *_progress(page), time.monotonic()
    stops: list[str] = []
    while time.monotonic() - start_s < seconds:
        time.sleep(0.25)
        reason = page.evaluate(f"{_STATE}.robot?.mode === 'stopped' && {_STATE}.robot.stop_reason")
        if reason:
            stops.append(str(reason))
            _touch(tools, "touchEnd")
            _start_and_hold(page, tools)
    lasted_s = time.monotonic() - start_s
    after, (learned_then, painted_then) = _metrics(tools), _progress(page)
    _touch(tools, "touchEnd")
    tools.send("Emulation.setCPUThrottlingRate", {"rate": 1})
    busy = {name: (after[name] - before[name]) / lasted_s for name in _BUSY}
    return {
        "throttle": throttle,
        "busy": round(busy["TaskDuration"], 4),
        "script": round(busy["ScriptDuration"], 4),
        "layout": round(busy["LayoutDuration"] + busy["RecalcStyleDuration"], 4),
        "painted_per_s": round((painted_then - painted) / lasted_s, 2),
        "learned_per_s": round((learned_then - learned) / lasted_s, 2),
        "stops": stops,
    }


def _start_and_hold(page: Any, tools: Any) -> None:
    """Choose to teach, and hold Forward with one finger."""
    deadline_s = time.monotonic() + _PATIENCE_S
    while page.evaluate(f"{_STATE}.robot?.mode") != "train":
        if time.monotonic() > deadline_s:
            raise ConfigurationError("the robot did not start to train within 30 s")
        page.evaluate("document.querySelector('mode-bar [data-mode=train]').click()")
        time.sleep(0.3)
    box = page.locator(".move[data-move=forward]").bounding_box()
    _touch(tools, "touchStart", x=box["x"] + box["width"] / 2, y=box["y"] + box["height"] / 2)


def _touch(tools: Any, kind: str, **point: float) -> None:
    points = [point] if point else []
    tools.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})


def _metrics(tools: Any) -> dict[str, float]:
    """Return Chromium's metrics of this page. All durations are in seconds."""
    rows = tools.send("Performance.getMetrics")["metrics"]
    return {row["name"]: row["value"] for row in rows}


def _progress(page: Any) -> tuple[float, float]:
    """Return the number of examples learned and the number of pictures painted."""
    learned = page.evaluate(f"{_STATE}.robot.lessons")
    painted = page.evaluate("document.querySelector('video-view').frames")
    return float(learned), float(painted)
