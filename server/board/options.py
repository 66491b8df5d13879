"""Options of `drivelesson serve` that make a robot part of a class."""

from __future__ import annotations

import argparse
from pathlib import Path


def configure(parser: argparse.ArgumentParser) -> None:
    text = "file with a class key; the robot obeys the board that has the same key"
    parser.add_argument("--class-key", type=Path, metavar="FILE", help=text)
