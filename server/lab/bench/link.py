"""Measures the delay and the CPU time of frames and commands over loopback, without a browser."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import itertools
import json
import sys
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from typing import Any

from robot.study.table import Cell, Table
from server.cli.parser import several, whole
from server.lab.bench.report import TOO_BUSY, add_usual, in_turns, percentiles, report
from server.lab.bench.subject import ServerUnderTest
from server.protocol import encode_acknowledgement, parse_picture

_SETTLE_S = 0.7
_COMMANDS, _COMMAND_EVERY_S = 100, 0.047


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--viewers", type=several(whole(1)), default="1,4,16", help="how many viewers (%(default)s)"
    )
    text = "number of measurements of each server, taken in turns (%(default)s)"
    parser.add_argument("--turns", type=whole(1), default=5, help=text)
    add_usual(parser, seconds=5.0)


def run(args: argparse.Namespace) -> int:
    result = asyncio.run(_measure_all(args.viewers, args.seconds, args.rate))
    for row in result["viewers"]:
        count, size = row["viewers"], row["bytes"] or 1
        _progress(f"{count} viewers, in turns with a plain server")
        row["beside_plain"] = asyncio.run(
            _compare(count, size, args.turns, args.seconds, args.rate)
        )
    return report(args, result, _table(result), _comparison(result))


async def _compare(
    count: int, size: int, turns: int, seconds: float, rate_hz: float
) -> dict[str, Any]:
    """Compare Drivelesson's server with a plain server: the CPU time of the serving thread per
    viewer and frame.

    The viewers leave one server before they join the other, so that only one has work at a time.
    """
    spent_us: list[list[float]] = [[], []]
    with (
        ServerUnderTest("drivelesson", rate_hz) as own,
        ServerUnderTest(size, rate_hz) as plain,
    ):
        for _ in range(turns):
            for subject, spent in zip((own, plain), spent_us, strict=True):
                async with watching(subject, count) as viewers:
                    await asyncio.sleep(2 * _SETTLE_S)
                    busy = await subject.watch(seconds)
                    seen = sum(len(ages_since(busy["start_s"], one)) for one in viewers)
                spent.append(1e6 * busy["serving_s"] / max(1, seen))
    return in_turns(*spent_us)


async def _measure_all(counts: Sequence[int], seconds: float, rate_hz: float) -> dict[str, Any]:
    result: dict[str, Any] = {"rate_hz": rate_hz, "viewers": []}
    for count in counts:
        _progress(f"{count} viewers")
        result["viewers"].append(await _measure_viewers(count, seconds, rate_hz))
    _progress("commands")
    result["commands"] = await _measure_commands(max(counts), rate_hz)
    return result


async def _measure_viewers(count: int, seconds: float, rate_hz: float) -> dict[str, Any]:
    with ServerUnderTest("drivelesson", rate_hz) as subject:
        await asyncio.sleep(_SETTLE_S)
        idle = await subject.watch(min(seconds, 2.0))
        async with watching(subject, count) as viewers:
            await asyncio.sleep(_SETTLE_S)
            busy = await subject.watch(seconds)
            ages_s = [age for viewer in viewers for age in ages_since(busy["start_s"], viewer)]
        await asyncio.sleep(_SETTLE_S)
        idle_after = await subject.watch(min(seconds, 2.0))
    shares = [spent["serving_s"] / spent["lasted_s"] for spent in (idle, busy, idle_after)]
    framed_s = busy["serving_s"] - min(shares[0], shares[2]) * busy["lasted_s"]
    return {
        "viewers": count,
        "frames_per_second": round(len(ages_s) / busy["lasted_s"] / count, 2),
        "bytes": busy["bytes"],
        "latency_ms": percentiles(ages_s),
        "cpu_us_per_frame": round(1e6 * framed_s / len(ages_s), 1) if ages_s else None,
        "process_cpu_us_per_frame": (
            round(1e6 * busy["process_s"] / len(ages_s), 1) if ages_s else None
        ),
        "serving_cpu_share": round(shares[1], 4),
        "serving_cpu_share_idle_before": round(shares[0], 4),
        "serving_cpu_share_idle_after": round(shares[2], 4),
        "loop_hz": round(busy["frames"] / busy["lasted_s"], 2),
        "late_cycles": busy["late_cycles"],
    }


async def _measure_commands(count: int, rate_hz: float) -> dict[str, Any]:
    """Measure the time from sending a new move until the robot's body executes it."""
    with ServerUnderTest("drivelesson", rate_hz) as subject:
        async with watching(subject, count), driving(subject) as send:
            sent: list[tuple[float, str]] = []
            for number in range(_COMMANDS):
                held = ("forward", "left")[number % 2]
                sent.append((time.monotonic(), held))
                await send(type="drive", held=held)
                await asyncio.sleep(_COMMAND_EVERY_S)
            notes = subject.ask()
    took_s = _pair_up(sent, notes["changes"])
    return {
        "viewers": count,
        "commands": _COMMANDS,
        "not_obeyed": _COMMANDS - len(took_s),
        "wire_to_drive_ms": percentiles(took_s),
        "cycle_ms": round(1000 / rate_hz, 2),
    }


def _pair_up(
    sent: Sequence[tuple[float, str]], changes: Sequence[tuple[float, str]]
) -> list[float]:
    """Return the time from each command to its effect. Commands that had no effect are left out."""
    took_s = []
    until_s = [at_s for at_s, _ in sent[1:]] + [sent[-1][0] + 1.0]
    for (at_s, held), next_s in zip(sent, until_s, strict=True):
        obeyed = [t for t, action in changes if action == held and at_s <= t < next_s]
        took_s += [obeyed[0] - at_s] if obeyed else []
    return took_s


Send = Callable[..., Awaitable[None]]
"""Sends a message as the pilot, with the number and the nonce of the newest frame."""


@contextlib.asynccontextmanager
async def driving(subject: ServerUnderTest, cookie: str = "") -> AsyncIterator[Send]:
    """Connect as the pilot and drive in training mode while the `with` block runs. Yield a function
    that sends a message."""
    from websockets.asyncio.client import connect

    url, headers = f"ws://127.0.0.1:{subject.port}/ws/drive", {"Cookie": cookie}
    async with connect(url, compression=None, additional_headers=headers) as pilot:
        seen: dict[str, int] = {}
        seqs = itertools.count(1)

        async def send(**words: str) -> None:
            await pilot.send(json.dumps({**words, "seq": next(seqs), **seen}))

        reading = asyncio.create_task(_read_all(pilot, seen))
        await asyncio.sleep(_SETTLE_S)
        # ask repeatedly, because the robot refuses to start while its picture is old
        while subject.ask()["mode"] != "train":
            await send(type="mode", mode="train")
            await asyncio.sleep(0.1)
        yield send
        reading.cancel()


async def _read_all(pilot: Any, seen: dict[str, int]) -> None:
    """Read all messages; store in `seen` the newest frame and nonce, for the next command."""
    async for text in pilot:
        message = json.loads(text)
        if message["type"] == "state" and message["frame"] is not None:
            seen.update(frame=message["frame"], nonce=message["nonce"])


Watched = list[tuple[float, float]]
"""For each frame: the time at which it reached a viewer, and its age at that time, in seconds."""


def ages_since(start_s: float, watched: Watched) -> list[float]:
    return [age_s for at_s, age_s in watched if at_s >= start_s]


async def _watch(port: int, watched: Watched) -> None:
    """Receive frames and acknowledge them until cancelled."""
    from websockets.asyncio.client import connect

    url = f"ws://127.0.0.1:{port}/ws/video"
    # Offer compression, as browsers do; the server decides whether to use it.
    async with connect(url, compression="deflate", max_size=None, ping_interval=None) as socket:
        async for message in socket:
            assert isinstance(message, bytes)
            picture, now_s = parse_picture(message), time.monotonic()
            watched.append((now_s, now_s - picture.captured_s))
            if not picture.quiet:
                await socket.send(encode_acknowledgement(picture.frame_id))


@contextlib.asynccontextmanager
async def watching(subject: ServerUnderTest, count: int) -> AsyncIterator[list[Watched]]:
    """While the `with` block runs, let `count` viewers watch; yield the frames that each
    viewer has received so far."""
    viewers: list[Watched] = [[] for _ in range(count)]
    tasks = [asyncio.create_task(_watch(subject.port, viewer)) for viewer in viewers]
    try:
        yield viewers
    finally:
        for task in tasks:
            task.cancel()
        for ended in await asyncio.gather(*tasks, return_exceptions=True):
            if isinstance(ended, Exception):
                print(f"a viewer failed: {ended!r}", file=sys.stderr)


def _comparison(result: dict[str, Any]) -> Table:
    columns = ("viewers", "product, us", "plain, us", "ratio", "spread", "turns", "load")
    rows = tuple((row["viewers"], *row["beside_plain"].values()) for row in result["viewers"])
    return Table(
        title="CPU of the serving thread for a viewer and frame, in turns with a plain websocket",
        columns=columns,
        rows=tuple(
            tuple("too busy to say" if cell is None else cell for cell in row) for row in rows
        ),
    )


def _progress(what: str) -> None:
    print(f"measuring: {what}", file=sys.stderr, flush=True)


def _table(result: dict[str, Any]) -> Table:
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (
            row["viewers"],
            row["frames_per_second"],
            *row["latency_ms"].values(),
            row["cpu_us_per_frame"],
            row["process_cpu_us_per_frame"],
            row["loop_hz"],
            row["late_cycles"],
        )
        for row in result["viewers"]
    )
    columns = (
        *("viewers", "frames/s", "p50 ms", "p95", "p99", "CPU us/frame", "process"),
        *("loop Hz", "late"),
    )
    times = result["commands"]["wire_to_drive_ms"]
    note = "\ncommand to drive, ms: " + ", ".join(f"{k} {v or '-'}" for k, v in times.items())
    if None in (*times.values(), *(cell for row in rows for cell in row)):
        note += "\n" + TOO_BUSY
    return Table(title="Pictures over loopback", columns=columns, rows=rows, note=note)
