"""What is left of the first place after four more were taught: one network, or one for each."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from robot.errors import MissingExtraError
from robot.lab import evaluation
from robot.policy.registry import make_policy
from server.cli.parser import whole


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("folder", type=Path, help="folder of recordings PLACE_A.npz, PLACE_B.npz")
    parser.add_argument("--nodes", type=whole(1), default=32, help="of each network (%(default)s)")


def run(args: argparse.Namespace) -> int:
    """Let each place be the first in turn, and print a table in Markdown."""
    try:
        from tqdm import tqdm
    except ImportError as error:
        raise MissingExtraError("the comparison of places", "evaluate") from error
    pairs = evaluation.load_pairs(args.folder)
    names = (f"default-{args.nodes}", f"multi-place-{args.nodes}", f"default-{args.nodes}")
    print(
        f"| first place | {names[0]}, taught it alone | {names[1]}, taught all | {names[2]}, "
        "taught all |\n|---|---|---|---|"
    )
    rows = []
    with tqdm(total=len(pairs), unit="drive", file=sys.stderr) as bar:
        for first, rates in _accuracies(pairs, names):
            rows.append(rates)
            bar.update()
            print(_row(f"{first.train.path.stem} to {first.test.path.stem}", rates), flush=True)
    print(_row("mean", np.mean(rows, axis=0).tolist()))
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


def _row(name: str, rates: Sequence[float]) -> str:
    return f"| {name} | {' | '.join(f'{rate:.3f}' for rate in rates)} |"
