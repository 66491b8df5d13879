"""Options of `drivelesson serve` for recordings."""

from __future__ import annotations

import argparse


def configure(parser: argparse.ArgumentParser) -> None:
    text = "also keep recordings in which nothing was taught (for research)"
    parser.add_argument("--keep-drives", action="store_true", help=text)
