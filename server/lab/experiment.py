"""Repeat the paper's experiments in simulation, and run further experiments."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Collection, Sequence
from dataclasses import fields
from pathlib import Path

from robot.errors import ConfigurationError, quoted
from robot.lab.experiment import (
    EXPERIMENTS,
    Experiment,
    ExperimentSettings,
    Runs,
    load_experiment,
)
from robot.lab.task import Task
from server.cli.parser import progress, whole
from server.lab.output import check_writable, write_json, write_text

_ROBOT = "sim"
USED_BY: dict[str, tuple[str, Collection[str]]] = {
    "learners": ("--learner", EXPERIMENTS.keys() - {"ablation", "streams"}),
    "teacher": ("--teacher", ("figure3", "figure6", "figure7", "figure8", "ablation")),
    "recordings": ("--recordings", ("figure3", "ablation")),
    "worlds": ("--world", ("ablation", "ground")),
    "robot": ("--robot", ("figure5",)),
}
"""The settings that only some experiments use. Maps each setting to its option, and to the names
of the experiments that use it."""


def configure(parser: argparse.ArgumentParser) -> None:
    add, shown = parser.add_argument, " (default: %(default)s)"
    add(
        "names",
        nargs="+",
        choices=(*EXPERIMENTS, "all"),
        metavar="EXPERIMENT",
        help=f"the experiment: {', '.join(EXPERIMENTS)}, all",
    )
    add("--seeds", type=whole(1), default=10, help=f"number of runs of each kind{shown}")
    add("--quick", action="store_true", help="only one run of each kind")
    add("--json", type=Path, metavar="FILE", help="also write every result here")
    add("--report", type=Path, metavar="FILE", help="the report (default: FOLDER/report.html)")
    add(
        "--learner",
        dest="learners",
        action="append",
        default=[],
        metavar="NAME",
        help="learner that replaces the experiment's own, such as default-32, published-64 or "
        "path.py:Name; may be given several times",
    )
    add("--teacher", metavar="NAME", help="teacher, such as usual, early, late or path.py:Name")
    add(
        "--world",
        dest="worlds",
        action="append",
        default=[],
        metavar="NAME",
        help="world of the experiment ground, such as Sidewalk, CarRacing or ViZDoom; may be given "
        "several times",
    )
    add("--recordings", metavar="FOLDER", help="folder of real footage for figure3")
    add("--robot", default=_ROBOT, help=f"robot whose speed figure5 measures{shown}")
    add(
        "--folder",
        type=Path,
        default=Path("experiments"),
        help="folder for finished runs (default: ./%(default)s)",
    )
    add("--jobs", type=whole(1), metavar="N", help="parallel runs (default: one per processor)")
    add("--backend", choices=("processes", "dask"), default="processes", help="what runs the tasks")
    add("--scheduler", metavar="ADDRESS", help="address of an existing Dask cluster's scheduler")


def run(args: argparse.Namespace) -> int:
    # Use one thread per process.
    # More threads would not be faster, and would change the last digit of sums.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[variable] = "1"
    from robot.lab.report import write_html

    settings = _settings(args)
    names = EXPERIMENTS if "all" in args.names else dict.fromkeys(args.names)
    planned = {name: load_experiment(name) for name in names}
    # Plan all experiments before the first run, so that errors are reported immediately.
    tasks = {name: list(experiment.plan(settings)) for name, experiment in planned.items()}
    for path in (args.json, args.report):
        check_writable(path)
    made: list[tuple[Experiment, Runs]] = []
    everything = {}
    for name, experiment in planned.items():
        runs = _run_all(name, experiment, tasks[name], args)
        made.append((experiment, runs))
        everything[name] = [
            {"kind": task.kind, "params": dict(task.params), "result": result}
            for task, result in runs
        ]
        for table in experiment.tables(runs):
            print(f"\n{table.as_text()}", flush=True)
        _print_speed(runs)
    report = args.report or args.folder / "report.html"
    write_text(report, write_html(made, " ".join(map(quoted, ["drivelesson", *sys.argv[1:]]))))
    print(f"\nThe report is in {report}")
    write_json(args.json, everything)
    return 0


def _settings(args: argparse.Namespace) -> ExperimentSettings:
    from robot.lab.ideas import make_learner, make_teacher
    from robot.types import DEFAULT_MOVES

    # a learner or world that is named twice counts once
    args.learners = list(dict.fromkeys(args.learners))
    args.worlds = list(dict.fromkeys(args.worlds))
    for learner in args.learners:
        make_learner(learner, DEFAULT_MOVES)
    if args.teacher:
        make_teacher(args.teacher, DEFAULT_MOVES)
    if args.recordings is not None and not Path(args.recordings).is_dir():
        raise ConfigurationError(f"--recordings: there is no folder {args.recordings}")
    _refuse_unused(args)
    args.recordings = args.recordings or os.environ.get("DRIVELESSON_RECORDINGS")
    names = (field.name for field in fields(ExperimentSettings))
    return ExperimentSettings(**{name: getattr(args, name) for name in names})


def _refuse_unused(args: argparse.Namespace) -> None:
    """Raise ConfigurationError for an option that none of the experiments uses."""
    for name, (flag, users) in USED_BY.items():
        is_given = getattr(args, name) not in (None, [], _ROBOT)
        if is_given and not {*users, "all"} & {*args.names}:
            raise ConfigurationError(
                f"{', '.join(args.names)} does not use {flag}; leave it out (used by "
                f"{', '.join(each for each in EXPERIMENTS if each in users)})"
            )


def _run_all(
    name: str, experiment: Experiment, tasks: Sequence[Task], args: argparse.Namespace
) -> Runs:
    from robot.lab.runner import Store, run_all

    is_alone = experiment.times_machine
    with progress(len(tasks), "run", "experiment", "experiments", name) as bar:

        def show_workers(count: int, change: str) -> None:
            if change:
                bar.write(f"{name}: {change}", file=sys.stderr)
            bar.set_postfix_str(f"{count} worker{'' if count == 1 else 's'}")

        results = run_all(
            tasks,
            Store(args.folder),
            jobs=1 if is_alone else args.jobs or os.cpu_count() or 1,
            backend="processes" if is_alone else args.backend,
            scheduler=args.scheduler,
            on_done=lambda task: bar.update(),
            on_workers=show_workers,
        )
    return list(zip(tasks, results, strict=True))


def _print_speed(runs: Runs) -> None:
    timings = [result.get("timing", {}) for _, result in runs]
    rates = [timing["frames_per_s"] for timing in timings if "frames_per_s" in timing]
    if rates:
        print(
            f"\nSimulation (render, features, learn, drive), one process: slowest run "
            f"{min(rates):.0f}, mean {sum(rates) / len(rates):.0f} frames a second"
        )
