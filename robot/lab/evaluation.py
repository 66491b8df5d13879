"""Learners compared on recorded footage: trained on one drive of a place, tested on another."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from robot.errors import CameraError, RecordingError
from robot.learner.base import Vector
from robot.policy.image import to_rgb
from robot.policy.policy import Policy
from robot.policy.registry import make_policy
from robot.store.table import Cell, Table
from robot.types import Action, Encoding, Frame, Point

if TYPE_CHECKING:
    from robot.exchange.npz import Recording

Vectors = dict[tuple[str, str, float], list[Vector]]
"""Features by their name, the recording's path and light: extracted once for all learners."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PairResult:
    """How one learner did on one pair of recordings; shares between 0 and 1.

    `calibration_error` is the expected difference between confidence and accuracy in ten equal
    bins of confidence (Guo et al. 2017); `novel` the share of views unlike all examples.
    Where the drives have angles: their mean error, the correlation, and by how much the answer
    changes from frame to frame (root mean square: the smoother, the less). `learn_ms` and
    `predict_ms` are the times of a frame on this machine, without the features.
    """

    place: str
    train: str
    test: str
    learner: str
    accuracy: float
    balanced_accuracy: float
    correct: int
    frames: int
    calibration_error: float
    novel: float
    angle_error: float | None = None
    angle_correlation: float | None = None
    angle_step: float | None = None
    learn_ms: float = 0.0
    predict_ms: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """Two drives of one place: learn from `train`, test on `test` with so much of its light.

    `examples` is how many frames of `train` are learned, spread evenly over it; None: all.
    """

    train: Recording
    test: Recording
    light: float = 1.0
    examples: int | None = None


def load_pairs(folder: Path | str, light: float = 1.0, examples: int | None = None) -> list[Pair]:
    """Return both directions of every place X that has X_A.npz and X_B.npz in `folder`.

    Args:
        folder: Where they are.
        light: How much of the light is left when the learner is tested.
        examples: How many frames of a drive are learned; None: all.

    Raises:
        RecordingError: If there is no such folder or pair, or a recording is broken.
    """
    from robot.exchange.npz import load_recording  # of another house, asked for when needed

    folder = Path(folder)
    if not folder.is_dir():
        raise RecordingError(f"there is no folder {folder}")
    pairs = recorded_pairs(folder)
    if not pairs:
        raise RecordingError(
            f"the folder {folder} has no recordings named PLACE_A.npz, PLACE_B.npz"
        )
    loaded = {path: load_recording(path) for path, _ in pairs}
    return [
        Pair(train=loaded[train], test=loaded[test], light=light, examples=examples)
        for train, test in pairs
    ]


def recorded_pairs(folder: Path) -> list[tuple[Path, Path]]:
    """Return the paths of each place's two recordings, both ways."""
    firsts = sorted(folder.glob("*_A.npz"))
    both = [(path, path.with_name(path.name.replace("_A.npz", "_B.npz"))) for path in firsts]
    return [pair for a, b in both for pair in ((a, b), (b, a))]


def evaluate(
    pairs: Sequence[Pair], learners: Sequence[str], tick: Callable[[], None] = lambda: None
) -> Iterator[PairResult]:
    """Yield each learner's result on each pair; `tick` is called after every one.

    Raises:
        ConfigurationError: If a learner is unknown.
        RecordingError: If a frame cannot be read.
    """
    for name in learners:
        make_policy(name)
    for pair in pairs:
        vectors: Vectors = {}
        for name in learners:
            policy = make_policy(name)
            yield judge(policy, pair, vectors)
            tick()


def _vectors(
    policy: Policy, recording: Recording, known: Vectors, light: float = 1.0
) -> list[Vector]:
    key = (policy.features.name, str(recording.path), light)
    if key not in known:
        frames = (recording.frame(i) for i in range(len(recording)))
        try:
            known[key] = [policy.extract(darkened(frame, light)) for frame in frames]
        except CameraError as error:
            raise RecordingError(f"the recording {recording.path}: {error}") from error
    return known[key]


def darkened(frame: Frame, light: float) -> Frame:
    """Return the frame as it would be with `light` of the light; raises CameraError."""
    if light == 1.0:
        return frame
    pixels = (to_rgb(frame) * light).astype(np.uint8)
    return replace(frame, encoding=Encoding.RGB, data=pixels.tobytes())


def judge(policy: Policy, pair: Pair, vectors: Vectors) -> PairResult:
    """Teach a new policy one drive and test it on the other; `vectors` caches the features."""
    first, *_ = _vectors(policy, pair.train, vectors)
    test = _vectors(policy, pair.test, vectors, pair.light)
    started_s = time.perf_counter()
    n_taught = teach(policy, pair.train, vectors, pair.examples)
    policy.propose(0, first)  # some are fitted only when asked
    learned_s = time.perf_counter() - started_s
    policy.reset()
    started_s = time.perf_counter()
    proposed = [policy.propose(i + 1, x) for i, x in enumerate(test)]
    predicted_s = time.perf_counter() - started_s
    accuracy, balanced = scores(pair.test.labels, [p.action for p in proposed])
    error, correlation, step = _angles(pair.test.points, [p.point for p in proposed])
    return PairResult(
        place=pair.train.place,
        train=pair.train.path.stem,
        test=pair.test.path.stem,
        learner=policy.name,
        accuracy=accuracy,
        balanced_accuracy=balanced,
        correct=round(accuracy * len(test)),
        frames=len(test),
        calibration_error=calibration_error(
            [p.confidence for p in proposed],
            [p.action is label for p, label in zip(proposed, pair.test.labels, strict=True)],
        ),
        novel=float(np.mean([p.is_novel for p in proposed])),
        angle_error=error,
        angle_correlation=correlation,
        angle_step=step,
        learn_ms=1000 * learned_s / n_taught,
        predict_ms=1000 * predicted_s / max(len(test), 1),
    )


def teach(
    policy: Policy, recording: Recording, vectors: Vectors, examples: int | None = None
) -> int:
    """Teach a policy one more drive, perhaps of another place than the last.

    Of a drive with more frames than `examples` only so many are learned, spread evenly over it.
    Returns how many were.
    """
    policy.reset()
    xs, labels, points = _vectors(policy, recording, vectors), recording.labels, recording.points
    n_taught = min(examples or len(xs), len(xs))
    for i in np.linspace(0, len(xs) - 1, n_taught).round().astype(int):
        policy.learn(xs[i], labels[i], None, points[i])
    return n_taught


def _angles(
    truth: Sequence[Point | None], proposed: Sequence[Point | None]
) -> tuple[float | None, float | None, float | None]:
    """Return mean error, correlation and step of the angle; None where it is not known."""
    known = [(t.steering, p.steering) for t, p in zip(truth, proposed, strict=True) if t and p]
    if not known:
        return None, None, None
    true, said = np.array(known).T
    is_flat = min(true.std(), said.std()) == 0.0
    return (
        float(np.abs(said - true).mean()),
        None if is_flat else float(np.corrcoef(said, true)[0, 1]),
        float(np.sqrt((np.diff(said) ** 2).mean())) if len(said) > 1 else 0.0,
    )


def calibration_error(
    confidences: Sequence[float], right: Sequence[bool], n_bins: int = 10
) -> float:
    """Return the mean over frames of |confidence - accuracy| of their bin of confidence."""
    values, hits = np.array(confidences), np.array(right, float)
    bins = np.minimum((values * n_bins).astype(int), n_bins - 1)
    gaps = [abs(float((values - hits)[bins == b].sum())) for b in range(n_bins)]
    return sum(gaps) / max(values.size, 1)


def scores(truth: Sequence[Action], proposed: Sequence[Action | None]) -> tuple[float, float]:
    """Return accuracy, and the mean over the true labels of the share that was recognised."""
    right = np.array([t is p for t, p in zip(truth, proposed, strict=True)])
    true = np.array([str(t) for t in truth])
    recalls = [float(right[true == label].mean()) for label in np.unique(true)]
    return float(right.mean()), float(np.mean(recalls))


def table(results: Sequence[PairResult]) -> Table:
    """Return one row a pair and learner, then the mean of each learner; of times, the median."""
    rows: list[tuple[Cell, ...]] = [
        (r.place, r.train, r.test, r.learner, f"{r.correct}/{r.frames}", *_figures([r]))
        for r in results
    ]
    for name in dict.fromkeys(r.learner for r in results):
        own = [r for r in results if r.learner == name]
        rows.append(("mean", "", "", name, "", *_figures(own)))
    columns = (
        *("place", "train", "test", "learner", "right", "acc.", "bal.", "calib."),
        *("angle", "corr.", "step"),
        *("learn ms", "predict ms"),
    )
    return Table(title="Taught on one drive, tested on another", columns=columns, rows=tuple(rows))


def _figures(results: Sequence[PairResult]) -> tuple[str, ...]:
    shares = ("accuracy", "balanced_accuracy", "calibration_error")
    angles = ("angle_error", "angle_correlation", "angle_step")
    means = (_joined(results, name, np.mean) for name in (*shares, *angles))
    medians = (_joined(results, name, np.median) for name in ("learn_ms", "predict_ms"))
    return (*means, *medians)


def _joined(results: Sequence[PairResult], name: str, join: Callable[[list[float]], Any]) -> str:
    """Return one figure of some results as text; empty where none has it."""
    known = [value for r in results if (value := getattr(r, name)) is not None]
    return f"{float(join(known)):.3f}" if known else ""
