"""Compare learners on recorded footage: train on one drive of a place, test on another drive."""

from __future__ import annotations

import argparse
import importlib.util
import os
import sys
from pathlib import Path

from robot.errors import ConfigurationError, MissingExtraError
from robot.lab import evaluation
from server.cli.parser import number, progress, several, whole
from server.lab.output import check_writable, write_json

OURS = ["published-32", "integer-32", "default-32", "linear-alone-32", "without-angle-32"]
BASELINES = [
    *("knn-9", "fair-knn-9", "fair-trees-100"),
    *("angle-knn-9", "angle-ridge-3", "angle-cnn-32"),
]


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=Path, help="folder with files PLACE_A.npz, PLACE_B.npz")
    parser.add_argument(
        "--learners",
        metavar="NAMES",
        help=f"learners, separated by commas (default: {','.join([*OURS, *BASELINES])}; the last "
        "six only if scikit-learn is installed)",
    )
    parser.add_argument(
        "--light",
        type=number(above=0.0, most=1.0),
        default=1.0,
        metavar="SHARE",
        help="brightness factor for the test pictures, 0 to 1 (default: 1.0)",
    )
    parser.add_argument(
        "--examples",
        type=several(whole(1)),
        metavar="N",
        help="learn only N frames of a drive, spread evenly over it; several numbers, separated by "
        "commas, are evaluated one after another (default: all)",
    )
    parser.add_argument(
        "--first",
        type=several(whole(1)),
        metavar="N",
        help="learn only the first N consecutive frames of a drive, as a pilot teaches; may be "
        "combined with --examples",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the results here")


def run(args: argparse.Namespace) -> int:
    # With more threads than cores, scikit-learn takes ten times as long for a picture.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    learners = _learners(args.learners)
    pairs = evaluation.load_pairs(args.folder)
    check_writable(args.json)
    results = []
    lessons = [evaluation.FramesToLearn(n, in_a_row=True) for n in args.first or ()]
    lessons = [*lessons, *map(evaluation.FramesToLearn, args.examples or ())] or [
        evaluation.WHOLE_DRIVE
    ]
    n_runs = len(pairs) * len(learners) * len(lessons)
    with progress(n_runs, "run", "evaluate", "evaluate") as bar:
        for result in evaluation.evaluate(pairs, learners, light=args.light, lessons=lessons):
            results.append(result)
            bar.update()
    print(evaluation.table(results).as_text())
    write_json(args.json, {"pairs": results})
    return 0


def _learners(names: str | None) -> list[str]:
    """Return the named learners; if `names` is None, ours and the baselines that can run here."""
    if names is not None:
        learners = list(dict.fromkeys(name.strip() for name in names.split(",") if name.strip()))
        if not learners:
            raise ConfigurationError(
                "--learners is empty: give it the name of at least one learner"
            )
        return learners
    if importlib.util.find_spec("sklearn") is not None:
        return [*OURS, *BASELINES]
    left_out = MissingExtraError(f"comparing with {', '.join(BASELINES)}", "evaluate")
    print(f"drivelesson: {left_out}", file=sys.stderr)
    return OURS
