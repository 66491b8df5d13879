"""How busy the page keeps a phone: main thread, pictures and examples.

A Chromium shows the page of a server in a process of its own and holds Forward with one finger;
for a slow phone DevTools slows its main thread.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

from robot.store.table import Table
from server.cli.output import numbers_in
from server.lab.bench.browser import STATE, DevToolsPage, running_browser
from server.lab.bench.process import ServerUnderTest
from server.lab.bench.report import add_json, report

_BUSY = ("TaskDuration", "ScriptDuration", "LayoutDuration", "RecalcStyleDuration")


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--seconds", type=float, default=10.0, help="for each (%(default)s)")
    parser.add_argument(
        "--throttle", default="1,4,6", help="how many times slower the phone is (%(default)s)"
    )
    parser.add_argument("--rate", type=float, default=30.0, help="pictures a second (%(default)s)")
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    rates = numbers_in(args.throttle, float, "--throttle")
    with ServerUnderTest("drivelesson", args.rate) as subject, running_browser() as page:
        page.open(f"http://127.0.0.1:{subject.port}/")
        rows = [_measure(page, subject, rate, args.seconds) for rate in rates]
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
    return report(args, rows, Table(title="The page's main thread", columns=columns, rows=lines))


def _measure(
    page: DevToolsPage, subject: ServerUnderTest, throttle: float, seconds: float
) -> dict[str, Any]:
    page.send("Emulation.setCPUThrottlingRate", rate=throttle)
    page.start_and_hold()
    time.sleep(2.0)
    before, learned, painted, start_s = page.metrics(), *_progress(page), time.monotonic()
    stops: list[str] = []
    while time.monotonic() - start_s < seconds:
        time.sleep(0.25)
        reason = page.evaluate(f"{STATE}.robot?.mode === 'stopped' && {STATE}.robot.stop_reason")
        if reason:
            stops.append(str(reason))
            page.release()
            page.start_and_hold()
    lasted_s = time.monotonic() - start_s
    after, (learned_then, painted_then) = page.metrics(), _progress(page)
    page.release()
    page.send("Emulation.setCPUThrottlingRate", rate=1)
    busy = {name: (after[name] - before[name]) / lasted_s for name in _BUSY}
    return {
        "throttle": throttle,
        "busy": round(busy["TaskDuration"], 4),
        "script": round(busy["ScriptDuration"], 4),
        "layout": round(busy["LayoutDuration"] + busy["RecalcStyleDuration"], 4),
        "painted_per_s": round((painted_then - painted) / lasted_s, 2),
        "learned_per_s": round((learned_then - learned) / lasted_s, 2),
        "stops": stops,
        "link": page.evaluate(f"{STATE}.robot.link"),
        "camera_hz": subject.ask()["cycle_hz"],
    }


def _progress(page: DevToolsPage) -> tuple[float, float]:
    """Return how many examples were learned and how many pictures painted."""
    learned = page.evaluate(f"{STATE}.robot.lessons")
    painted = page.evaluate("document.querySelector('video-view').frames")
    return float(learned), float(painted)
