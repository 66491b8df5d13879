"""What each part of the default learner is worth: without it, on recorded footage."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from robot.errors import need
from robot.lab import evaluation
from robot.lab.variants import VARIANTS
from robot.policy.registry import make_policy

KINDS = ("default", *VARIANTS, "published")


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=Path, help="folder of recordings PLACE_A.npz, PLACE_B.npz")
    parser.add_argument("--nodes", default="32,64", help="numbers of nodes (%(default)s)")


def run(args: argparse.Namespace) -> int:
    tqdm = need("tqdm", "the ablation", "evaluate").tqdm
    sizes = [int(size) for size in args.nodes.split(",")]
    pairs = evaluation.load_pairs(args.folder)
    vectors: evaluation.Vectors = {}
    heads = " | ".join(f"{size} nodes | balanced | calibration" for size in sizes)
    print(f"| kind | {heads} |\n|---|{'---|' * 3 * len(sizes)}")
    for kind in tqdm(KINDS, unit="kind", file=sys.stderr):
        cells = []
        for size in sizes:
            results = [
                evaluation.judge(make_policy(f"{kind}-{size}"), pair, vectors) for pair in pairs
            ]
            cells += [
                f"{np.mean([getattr(r, field) for r in results]):.3f}"
                for field in ("accuracy", "balanced_accuracy", "calibration_error")
            ]
        print(f"| {kind} | {' | '.join(cells)} |", flush=True)
    return 0
