"""Prints the result of a benchmark as tables, or writes its figures as JSON."""

from __future__ import annotations

import argparse
import json
import os
import statistics
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from robot.study.table import Table
from server.cli.parser import number
from server.lab.output import write_json


def add_usual(parser: argparse.ArgumentParser, seconds: float) -> None:
    """Declare the options that benchmarks share: length of a measurement, frame rate, JSON."""
    positive = number(above=0)
    text = "seconds of each measurement (%(default)s)"
    parser.add_argument("--seconds", type=positive, default=seconds, help=text)
    parser.add_argument(
        "--rate", type=positive, default=30.0, help="pictures a second (%(default)s)"
    )
    add_json(parser)


def add_json(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--json",
        nargs="?",
        const="-",
        metavar="FILE",
        help="write the figures to a file, or print them in place of the tables",
    )


def report(args: argparse.Namespace, figures: Any, *tables: Table) -> int:
    """Print the tables, or the figures as JSON if `--json` is given; return the exit status."""
    if args.json == "-":
        print(json.dumps(figures, indent=1))
        return 0
    print("\n\n".join(table.as_text() for table in tables))
    write_json(args.json and Path(args.json), figures)
    return 0


TOO_BUSY = "Figures are missing (-), because the computer was too busy: close other programs."


def percentiles(seconds: Sequence[float]) -> dict[str, Any]:
    """Return the 50th, 95th and 99th percentiles of times, in ms; None if there are no times."""
    found = 1000 * np.percentile(seconds or [0.0], (50, 95, 99), method="inverted_cdf")
    known = found.round(2).tolist() if seconds else 3 * [None]
    return dict(zip(("p50", "p95", "p99"), known, strict=True))


def in_turns(own: Sequence[float], peer: Sequence[float]) -> dict[str, Any]:
    """Compare measurements of two servers that were made in turns.

    Returns:
        The medians `own` and `peer`. Each turn measures both servers; `ratio` is the median over
        the turns of own / peer. `ratio` is None if the machine was too busy: the ratios of the
        turns then differ by more than their median.
    """
    ratios = [one / other for one, other in zip(own, peer, strict=True)]
    ratio, spread = statistics.median(ratios), max(ratios) - min(ratios)
    return {
        "own": round(statistics.median(own), 1),
        "peer": round(statistics.median(peer), 1),
        "ratio": round(ratio, 3) if spread <= ratio else None,
        "spread": round(spread, 3),
        "turns": len(ratios),
        "load": round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else None,
    }
