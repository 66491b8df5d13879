"""Measures the times to learn and to predict, and the frame rates that these times permit, for
different numbers of nodes."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.learner.bsoc import BSOC
from robot.policy import autosize
from robot.study.table import Table
from server.lab.bench.report import add_json, report

N_BYTES = 2400
_BLOCK = 50
Step = Callable[[NDArray[np.uint8]], object]


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--learner", default="default", help="the learner (%(default)s)")
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    policies = [
        _as_dict(autosize.measure(size, kind=args.learner, repeats=300)) for size in autosize.SIZES
    ]
    result = {
        "learner": args.learner,
        "policies": policies,
        "cluster": {"bytes": N_BYTES, "sizes": [_cluster(size) for size in autosize.SIZES]},
    }
    return report(args, result, *_tables(result))


def _as_dict(cost: autosize.Cost) -> dict[str, float]:
    return {
        "max_nodes": cost.max_nodes,
        "extract_us": float(np.median(cost.extract_s)) * 1e6,
        "predict_us": float(np.median(cost.propose_s)) * 1e6,
        "predict_p99_us": float(np.percentile(cost.propose_s, 99)) * 1e6,
        "learn_us": float(np.median(cost.learn_s)) * 1e6,
        "learn_p99_us": float(np.percentile(cost.learn_s, 99)) * 1e6,
        "frames_per_second": 1.0 / cost.frame_s,
    }


def _cluster(max_nodes: int) -> dict[str, float]:
    """Time training steps, look-ups and bare matrix products in turns, so that other programs slow
    all three equally."""
    frames = _frames(600 if max_nodes < 512 else 300)
    learner = BSOC(max_nodes)
    rng = np.random.default_rng(1)
    for i in range(max_nodes):
        learner.train(rng.integers(0, 256, N_BYTES).astype(np.uint8) // 2 + frames[i % 300] // 2)
    matrix = rng.random((max_nodes, N_BYTES)).astype(np.float32)
    vector = rng.random(N_BYTES).astype(np.float32)
    steps: tuple[Step, ...] = (lambda _: matrix @ vector, learner.train, learner.lookup)
    took_us: list[list[float]] = [[], [], []]
    for start in range(0, len(frames), _BLOCK):
        for step, times_us in zip(steps, took_us, strict=True):
            times_us += _times_us(step, frames[start : start + _BLOCK])
    product_us, train_us, lookup_us = (float(np.median(times_us)) for times_us in took_us)
    return {
        "max_nodes": max_nodes,
        "train_us": train_us,
        "train_p99_us": float(np.percentile(took_us[1], 99)),
        "lookup_us": lookup_us,
        "product_us": product_us,
        "train_per_product": train_us / product_us,
    }


def _frames(count: int) -> list[NDArray[np.uint8]]:
    """Return vectors of bytes like those of a drive through one place: forty random scenes, each
    with random noise."""
    rng = np.random.default_rng(0)
    scenes = rng.integers(0, 256, (40, N_BYTES))
    noise = rng.integers(-30, 31, (count, N_BYTES))
    mixed = (scenes[rng.integers(0, 40, count)] + noise).clip(0, 255).astype(np.uint8)
    return list(mixed)


def _times_us(step: Step, block: list[NDArray[np.uint8]]) -> list[float]:
    return [1e6 * took_s for took_s in autosize.times(lambda i: step(block[i]), len(block))]


def _tables(result: dict[str, Any]) -> tuple[Table, Table]:
    policies = Table(
        title=f"learner {result['learner']}, microseconds",
        columns=("nodes", "extract", "predict", "p99", "learn", "p99", "frames/s"),
        rows=tuple(tuple(f"{value:.0f}" for value in row.values()) for row in result["policies"]),
    )
    cluster = Table(
        title=f"only the clustering, vectors of {N_BYTES} bytes, microseconds",
        columns=("nodes", "train", "p99", "lookup", "product", "train/product"),
        rows=tuple(tuple(row.values()) for row in result["cluster"]["sizes"]),
    )
    return policies, cluster
