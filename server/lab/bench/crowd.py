"""Measures how much the control loop is slowed down by greedy viewers while a pilot drives.

The greedy viewers, each a separate process, request every address as fast as the server answers.
They are paused (by SIGSTOP) and resumed in turn, so that other load on the machine affects both
cases alike. A pilot drives throughout.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import signal
import subprocess
import sys
from collections.abc import AsyncIterator
from itertools import pairwise
from typing import Any

from robot.study.table import Table
from server.cli.parser import whole
from server.lab.bench import link
from server.lab.bench.report import TOO_BUSY, add_usual, percentiles, report
from server.lab.bench.subject import ServerUnderTest

_TURNS = 4
"""Number of measurements with greedy viewers, and also of measurements without them."""
_ASKED_RATIO = 1.5


def configure(parser: argparse.ArgumentParser) -> None:
    text = "number of greedy viewers (%(default)s)"
    parser.add_argument("--greedy", type=whole(1, 60), default=8, help=text)
    text = "number of viewers (%(default)s)"
    parser.add_argument("--viewers", type=whole(1, 150), default=50, help=text)
    add_usual(parser, seconds=5.0)


def run(args: argparse.Namespace) -> int:
    greedy = asyncio.run(_measure_greedy(args.greedy, args.seconds, args.rate))
    watched = asyncio.run(_measure_watched(args.viewers, args.seconds, args.rate))
    alone, together = greedy["without"], greedy["with"]
    ratio = (
        f"is {greedy['ratio'] or '-'} times that without greedy viewers (limit: {_ASKED_RATIO}), "
        f"{greedy['stops']} stops"
    )
    loop = Table(
        title=f"The loop's period, ms; p99 {ratio}",
        columns=("who reads", *alone),
        rows=(("nobody", *alone.values()), (f"{args.greedy} greedy viewers", *together.values())),
    )
    crowd = Table(
        title=f"{args.viewers} viewers and a pilot",
        columns=tuple(watched),
        rows=(tuple(watched.values()),),
        note=f"\n{TOO_BUSY}" if None in (greedy["ratio"], *watched.values()) else "",
    )
    return report(args, {"greedy": greedy, "watched": watched}, loop, crowd)


async def _measure_greedy(count: int, seconds: float, rate_hz: float) -> dict[str, Any]:
    periods_s: list[list[float]] = [[], []]
    stops = 0
    with ServerUnderTest("paired", rate_hz) as subject:
        words = [sys.executable, "-m", "server.lab.bench.greedy", str(subject.port)]
        async with _held_forward(subject, subject.pair("pilot")):
            viewers = [subprocess.Popen([*words, subject.pair("viewer")]) for _ in range(count)]
            try:
                # do not measure the first requests, which import modules and fill caches
                await asyncio.sleep(5.0)
                for turn in range(2 * _TURNS):
                    reads = turn % 2
                    for viewer in viewers:
                        viewer.send_signal(signal.SIGCONT if reads else signal.SIGSTOP)
                    await asyncio.sleep(0.5)
                    seen = await subject.watch(seconds)
                    periods_s[reads] += [b - a for a, b in pairwise(seen["ticked_s"])]
                    stops += seen["stops"]
            finally:
                for viewer in viewers:
                    viewer.kill()
                    viewer.wait()
    alone, together = map(percentiles, periods_s)
    return {
        "without": alone,
        "with": together,
        "ratio": round(together["p99"] / alone["p99"], 2) if all(periods_s) else None,
        "stops": stops,
    }


async def _measure_watched(count: int, seconds: float, rate_hz: float) -> dict[str, Any]:
    with ServerUnderTest("drivelesson", rate_hz) as subject:
        async with _held_forward(subject), link.watching(subject, count) as viewers:
            await asyncio.sleep(2.0)
            busy = await subject.watch(seconds)
            ages_s = [link.ages_since(busy["start_s"], viewer) for viewer in viewers]
    rates = [len(seen) / busy["lasted_s"] for seen in ages_s]
    return {
        "slowest_hz": round(min(rates), 1),
        "mean_hz": round(sum(rates) / count, 1),
        "age_p99_ms": percentiles([age for seen in ages_s for age in seen])["p99"],
        "cpu": round(busy["process_s"] / busy["lasted_s"], 3),
        "loop_hz": round(busy["frames"] / busy["lasted_s"], 1),
        "stops": busy["stops"],
    }


@contextlib.asynccontextmanager
async def _held_forward(subject: ServerUnderTest, cookie: str = "") -> AsyncIterator[None]:
    """While the `with` block runs, hold Forward, like a finger on the pad."""
    async with link.driving(subject, cookie) as send:

        async def hold() -> None:
            while True:
                await send(type="drive", held="forward")
                await asyncio.sleep(0.1)

        holding = asyncio.create_task(hold())
        yield
        holding.cancel()
