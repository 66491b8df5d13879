"""What each part of the default learner is worth: without it, on recorded footage."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from robot import evaluation
from robot.errors import MissingExtraError
from robot.features import GradientFeatures, GreyFeatures
from robot.learner.classifier import BSOCClassifier
from robot.learner.ridge import RecursiveRidge
from robot.policy import Policy, make_policy


def _ridge() -> RecursiveRidge:
    return RecursiveRidge(GradientFeatures.n_gradients)


def _policy(learner: BSOCClassifier, **steadiness: object) -> Policy:
    return Policy("ablation", learner.max_nodes, learner, GradientFeatures(), **steadiness)  # type: ignore[arg-type]


VARIANTS: dict[str, Callable[[int], Policy]] = {
    "default": lambda m: make_policy(f"default-{m}"),
    "without the linear part": lambda m: _policy(BSOCClassifier(m)),
    "the linear part alone": lambda m: _policy(
        BSOCClassifier(m, linear=_ridge(), linear_share=1.0)
    ),
    "labels merged freely": lambda m: _policy(BSOCClassifier(m, group_cost=1.0, linear=_ridge())),
    "one node votes": lambda m: _policy(BSOCClassifier(m, n_voters=1, linear=_ridge())),
    "no running average": lambda m: _policy(BSOCClassifier(m, linear=_ridge()), votes_kept=0.0),
    "no commitment to a turn": lambda m: _policy(BSOCClassifier(m, linear=_ridge()), commits=False),
    "grey alone, no linear part": lambda m: Policy(
        "ablation", m, BSOCClassifier(m), GreyFeatures()
    ),
    "whole numbers alone": lambda m: make_policy(f"default-{m}", integer=True),
    "published": lambda m: make_policy(f"published-{m}"),
}


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("folder", type=Path, help="folder of recordings PLACE_A.npz, PLACE_B.npz")
    parser.add_argument("--nodes", default="32,64", help="numbers of nodes (%(default)s)")


def run(args: argparse.Namespace) -> int:
    """Evaluate every variant, and print a table in Markdown."""
    try:
        from tqdm import tqdm
    except ImportError as error:
        raise MissingExtraError("the ablation", "evaluate") from error
    sizes = [int(size) for size in args.nodes.split(",")]
    pairs = evaluation.load_pairs(args.folder)
    vectors: evaluation.Vectors = {}
    heads = " | ".join(f"{size} nodes | balanced | calibration" for size in sizes)
    print(f"| variant | {heads} |\n|---|{'---|' * 3 * len(sizes)}")
    for name, make in tqdm(VARIANTS.items(), unit="variant", file=sys.stderr):
        cells = []
        for size in sizes:
            results = [evaluation.judge(make(size), pair, vectors) for pair in pairs]
            cells += [
                f"{np.mean([getattr(r, field) for r in results]):.3f}"
                for field in ("accuracy", "balanced_accuracy", "calibration_error")
            ]
        print(f"| {name} | {' | '.join(cells)} |", flush=True)
    return 0
