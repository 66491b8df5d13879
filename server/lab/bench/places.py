"""What is left of the first place after four more were taught: one network, or one for each."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from robot.lab import evaluation
from robot.policy.registry import make_policy
from robot.store.table import Table
from server.cli.output import progress
from server.cli.parser import whole


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=Path, help="folder of recordings PLACE_A.npz, PLACE_B.npz")
    parser.add_argument("--nodes", type=whole(1), default=32, help="of each network (%(default)s)")


def run(args: argparse.Namespace) -> int:
    pairs = evaluation.load_pairs(args.folder)
    default, places = f"default-{args.nodes}", f"multi-place-{args.nodes}"
    rows: dict[str, list[float]] = {}
    with progress(len(pairs), "drive", "bench", "evaluate") as bar:
        for first, rates in _accuracies(pairs, (default, places, default)):
            rows[f"{first.train.path.stem} to {first.test.path.stem}"] = rates
            bar.update()
    rows["mean"] = np.mean(list(rows.values()), axis=0).tolist()
    lines = tuple((name, *(f"{rate:.3f}" for rate in rates)) for name, rates in rows.items())
    heads = (f"{default}, taught it alone", f"{places}, taught all", f"{default}, taught all")
    print(Table(title="Right", columns=("first place", *heads), rows=lines).as_text())
    return 0


def _accuracies(
    pairs: Sequence[evaluation.Pair], names: Sequence[str]
) -> Iterator[tuple[evaluation.Pair, list[float]]]:
    vectors: evaluation.Vectors = {}
    for first in pairs:
        side = pairs.index(first) % 2
        others = [pair for pair in pairs[side::2] if pair is not first]
        rates = []
        for name, more in zip(names, ([], others, others), strict=True):
            policy = make_policy(name)
            for pair in [first, *more]:
                evaluation.teach(policy, pair.train, vectors)
            rates.append(evaluation.examine(policy, first, vectors).accuracy)
        yield first, rates
