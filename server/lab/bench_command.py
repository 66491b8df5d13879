"""Measure this machine: `drivelesson bench NAME [OPTION ...]`."""

from __future__ import annotations

import argparse
import importlib
import importlib.util
from collections.abc import Sequence
from types import ModuleType

from robot.errors import ConfigurationError

BENCHMARKS = ("crowd", "learner", "link", "page")
"""Modules of `server.lab.bench`; each has `configure(parser)` and `run(args) -> int`."""


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("benchmark", choices=BENCHMARKS)


def extend(parser: argparse.ArgumentParser, words: Sequence[str]) -> None:
    """Declare the options of the chosen benchmark."""
    if words and words[0] in BENCHMARKS:
        _load(words[0]).configure(parser)


def run(args: argparse.Namespace) -> int:
    return int(_load(args.benchmark).run(args))


def _load(name: str) -> ModuleType:
    if importlib.util.find_spec("server.lab.bench") is None:
        raise ConfigurationError(
            "the benchmarks measure the source code and are not part of an installed drivelesson; "
            f"run them in a clone of the repository, with: .venv/bin/drivelesson bench {name}"
        )
    return importlib.import_module(f"server.lab.bench.{name}")
