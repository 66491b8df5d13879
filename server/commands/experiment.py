"""Repeat the paper's experiments, and those beyond it, in simulation."""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from robot.errors import ConfigurationError, MissingExtraError

if TYPE_CHECKING:
    from robot.experiments.experiment import Experiment, Settings
    from robot.experiments.task import Result, Task

NAMES = ("figure7",)


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("name", choices=(*NAMES, "all"), help="which experiment")
    parser.add_argument("--seeds", type=int, default=10, help="runs of each (default: %(default)s)")
    parser.add_argument("--quick", action="store_true", help="few and short runs: a first look")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write all results here")
    parser.add_argument(
        "--learner",
        action="append",
        default=[],
        metavar="NAME",
        help="default-32, published-64, path.py:Name ...; may be given several times",
    )
    parser.add_argument("--teacher", metavar="NAME", help="usual, early, late, path.py:Name ...")
    parser.add_argument(
        "--folder",
        type=Path,
        default=Path("experiments"),
        help="where finished runs are kept (default: ./%(default)s)",
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="runs at a time")
    parser.add_argument(
        "--backend", choices=("processes", "dask"), default="processes", help="where runs run"
    )
    parser.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster")


def run(args: argparse.Namespace) -> int:
    """Run what is missing, then print the tables."""
    # One thread each: sums in another order would differ in the last digit, and be no faster.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[variable] = "1"
    from robot.experiments.catalogue import EXPERIMENTS
    from robot.experiments.experiment import Settings

    if args.seeds < 1 or (args.jobs or 1) < 1:
        raise ConfigurationError("--seeds and --jobs must be at least 1")
    settings = Settings(
        seeds=args.seeds, quick=args.quick, learners=tuple(args.learner), teacher=args.teacher
    )
    names = NAMES if args.name == "all" else (args.name,)
    everything = {}
    for name in names:
        experiment = EXPERIMENTS[name]
        tasks, results = _run_one(experiment, settings, args)
        everything[name] = [
            {"kind": task.kind, "params": dict(task.params), "result": result}
            for task, result in zip(tasks, results, strict=True)
        ]
        for table in experiment.tables(settings, tasks, results):
            print(f"\n{table.as_text()}")
    if args.json is not None:
        _write(args.json, json.dumps(everything, indent=1) + "\n")
    return 0


def _run_one(
    experiment: Experiment, settings: Settings, args: argparse.Namespace
) -> tuple[list[Task], list[Result]]:
    from robot.experiments.runner import run_all
    from robot.experiments.store import Store

    try:
        from tqdm import tqdm
    except ImportError as error:
        raise MissingExtraError("the command experiment", "experiments") from error
    tasks = experiment.plan(settings)
    with tqdm(total=len(tasks), desc=experiment.name, unit="run", file=sys.stderr) as bar:
        results = run_all(
            tasks,
            Store(args.folder),
            jobs=args.jobs or 1,
            backend=args.backend,
            scheduler=args.scheduler,
            on_done=lambda task: bar.update(),
        )
    return tasks, results


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ConfigurationError(f"cannot write {path}: {error}") from error
