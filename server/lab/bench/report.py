"""What a benchmark says: tables, or the figures as JSON."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from robot.store.table import Table
from server.cli.output import write_json


def add_json(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--json",
        nargs="?",
        const="-",
        metavar="FILE",
        help="write the figures to a file, or print them in place of the tables",
    )


def report(args: argparse.Namespace, figures: Any, *tables: Table) -> int:
    """Print the tables, or the figures; return the exit status."""
    if args.json == "-":
        print(json.dumps(figures, indent=1))
        return 0
    print("\n\n".join(table.as_text() for table in tables))
    write_json(args.json and Path(args.json), figures)
    return 0


def percentile(values: Sequence[float], percent: float) -> float:
    """Return the least value that so many percent do not exceed; nan if there are none."""
    if not values:  # a machine that was too busy to show a single picture
        return math.nan
    return sorted(values)[max(0, math.ceil(len(values) * percent / 100) - 1)]
