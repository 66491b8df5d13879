"""Compares learners on recorded footage: each is trained on one drive of a place and tested on
another."""

from __future__ import annotations

import itertools
import statistics
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot.errors import RecordingError
from robot.lab.task import Result
from robot.learner.base import Vector
from robot.policy.features import Features
from robot.policy.image import to_rgb
from robot.policy.policy import Policy
from robot.policy.registry import make_policy
from robot.study.table import Cell, Table
from robot.types import Action, Encoding, Frame, Point

if TYPE_CHECKING:
    from robot.exchange.drive import Drive

Vectors = dict[tuple[type[Features], str, str, float], list[Vector]]
"""Cache of the feature vectors of each drive in each light. Learners with the same features share
the vectors."""
Seen = Sequence[tuple[Vector, Action, Point | None]]
"""The examples of a drive. Each example has the feature vector, the label, and the pilot's steering
and throttle (None if the pilot did not steer proportionally)."""


class Pair(NamedTuple):
    """Two drives of one place: one for training, one for the test."""

    train: Drive
    test: Drive

    @property
    def place(self) -> str:
        return self.train.name.rpartition("_")[0] or self.train.name


class FramesToLearn(NamedTuple):
    """How much of a drive is learned.

    Attributes:
        frames: Maximum number of frames; None means all frames.
        in_a_row: True to learn the first frames, as when a pilot teaches; False to learn frames
            that are spread evenly over the drive. A few such frames already show the whole drive,
            which favours learners that need few examples.
    """

    frames: int | None = None
    in_a_row: bool = False

    @property
    def name(self) -> str:
        if self.frames is None:
            return "all"
        return f"first {self.frames}" if self.in_a_row else f"{self.frames} spread"

    def places(self, n: int) -> NDArray[np.intp]:
        """Return the indices, in ascending order, of the frames to learn from a drive of `n`
        frames."""
        count = min(self.frames or n, n)
        return (
            np.arange(count) if self.in_a_row else np.linspace(0, n - 1, count).round().astype(int)
        )


WHOLE_DRIVE = FramesToLearn()


def load_pairs(folder: Path | str) -> list[Pair]:
    """Load the recordings of all places in a folder. A place X has the recordings X_A.npz and
    X_B.npz, and yields two pairs: train on A and test on B, and the reverse. Raises RecordingError
    if there is no such folder or pair, or if a recording is damaged."""
    # imported here, because it is part of another extension
    from robot.exchange.npz import load_recording

    pairs = recorded_pairs(Path(folder))
    loaded = {path: load_recording(path) for path, _ in pairs}
    return [Pair(loaded[train], loaded[test]) for train, test in pairs]


def recorded_pairs(folder: Path) -> list[tuple[Path, Path]]:
    """Return the paths of the two recordings of each place, in both orders. Raises RecordingError
    if there is no such folder or recording."""
    if not folder.is_dir():
        raise RecordingError(f"there is no folder {folder}")
    firsts = sorted(folder.glob("[!.]*_A.npz"))
    if not firsts:
        raise RecordingError(
            f"{folder} has no recordings named PLACE_A.npz, PLACE_B.npz; write each with: "
            "drivelesson episodes export NAME --as npz --out PLACE_A.npz"
        )
    both = [(path, path.with_name(path.name.replace("_A.npz", "_B.npz"))) for path in firsts]
    return [pair for a, b in both for pair in ((a, b), (b, a))]


def evaluate(
    pairs: Sequence[Pair],
    learners: Sequence[str],
    *,
    light: float = 1.0,
    lessons: Sequence[FramesToLearn] = (WHOLE_DRIVE,),
) -> Iterator[Result]:
    """Teach each learner each lesson of each pair, and test it. Yield the results of `judge`, with
    the names of learner, lesson and pair.

    Args:
        light: Share of the light that is left in the test.
        lessons: The parts of a drive that are learned.

    Raises:
        ConfigurationError: If a learner is unknown.
        RecordingError: If a frame cannot be read.
    """
    for name in learners:
        make_policy(name)
    for pair in pairs:
        vectors: Vectors = {}
        drives = {"train": pair.train.name, "test": pair.test.name}
        for name, lesson in itertools.product(learners, lessons):
            policy = make_policy(name)
            train = seen_by(policy, pair.train, vectors)
            test = seen_by(policy, pair.test, vectors, light)
            found = judge(policy, train, test, lesson)
            yield {"place": pair.place, **drives, "learner": name, "lesson": lesson.name, **found}


def seen_by(policy: Policy, drive: Drive, known: Vectors, light: float = 1.0) -> Seen:
    """Return the labelled frames of a drive as examples for the policy. Before the features are
    computed, the brightness is multiplied by `light`."""
    # Policies of one kind share vectors only if their features do not depend on earlier pictures.
    whose = policy.name if getattr(policy.features, "__dict__", True) else ""
    key = (type(policy.features), whose, drive.name, light)
    if key not in known:
        frames = (shot.frame(0, 0.0) for shot in drive.shots)
        known[key] = [policy.extract(darkened(frame, light)) for frame in frames]
    pairs = zip(known[key], drive.shots, strict=True)
    return [(x, shot.label, shot.point) for x, shot in pairs if shot.label is not None]


def darkened(frame: Frame, light: float) -> Frame:
    """Return the frame with its brightness multiplied by `light`."""
    if light == 1.0:
        return frame
    pixels = (to_rgb(frame) * light).astype(np.uint8)
    return replace(frame, encoding=Encoding.RGB, data=pixels.tobytes())


def judge(policy: Policy, train: Seen, test: Seen, lesson: FramesToLearn = WHOLE_DRIVE) -> Result:
    """Teach a new policy one drive and test it on the other.

    Returns:
        Shares between 0 and 1. `calibration_error` is the expected difference between confidence
        and accuracy in ten equal bins of confidence (Guo et al. 2017). `novel` is the share of
        frames that are unlike all examples. If the drives have angles, there are also the mean
        error and the correlation of the angles, and the root mean square of their change from frame
        to frame, which is small if the driving is smooth. `learn_ms` and `predict_ms` are the times
        per frame on this machine, without the extraction of features.
    """
    started_s = time.perf_counter()
    n_taught = teach(policy, train, lesson)
    policy.propose(0, train[0][0])  # some learners fit their model only at the first prediction
    learned_s = time.perf_counter() - started_s
    policy.reset()
    started_s = time.perf_counter()
    proposed = [policy.propose(i + 1, x) for i, (x, *_) in enumerate(test)]
    predicted_s = time.perf_counter() - started_s
    _, labels, points = zip(*test, strict=True)
    accuracy, balanced = scores(labels, [p.action for p in proposed])
    return {
        "accuracy": accuracy,
        "balanced_accuracy": balanced,
        "correct": round(accuracy * len(test)),
        "frames": len(test),
        "calibration_error": calibration_error(
            [p.confidence for p in proposed],
            [p.action is label for p, label in zip(proposed, labels, strict=True)],
        ),
        "novel": float(np.mean([p.is_novel for p in proposed])),
        **_angles(points, [p.point for p in proposed]),
        "learn_ms": 1000 * learned_s / n_taught,
        "predict_ms": 1000 * predicted_s / len(test),
    }


def teach(policy: Policy, drive: Seen, lesson: FramesToLearn = WHOLE_DRIVE) -> int:
    """Teach a policy one drive. The policy may have learned other drives before.

    Returns the number of learned frames.
    """
    policy.reset()
    places = lesson.places(len(drive))
    for i in places:
        x, label, point = drive[i]
        policy.learn(x, label, None, point)
    return len(places)


def _angles(
    truth: Sequence[Point | None], proposed: Sequence[Point | None]
) -> dict[str, float | None]:
    """Return the angle's mean error, correlation and RMS change per frame; None if unknown."""
    known = [(t.steering, p.steering) for t, p in zip(truth, proposed, strict=True) if t and p]
    found = dict.fromkeys(("angle_error", "angle_correlation", "angle_step"))
    if known:
        true, said = np.array(known).T
        found["angle_error"] = float(np.abs(said - true).mean())
        if min(true.std(), said.std()) > 0.0:
            found["angle_correlation"] = float(np.corrcoef(said, true)[0, 1])
        found["angle_step"] = float(np.sqrt((np.diff(said) ** 2).mean())) if known[1:] else 0.0
    return found


def calibration_error(confidences: Sequence[float], right: Sequence[bool]) -> float:
    """Return the expected calibration error with ten bins: the mean of |confidence - accuracy| over
    the bins, weighted by their numbers of frames."""
    values, hits = np.array(confidences), np.array(right, float)
    tenths = np.minimum((values * 10).astype(int), 9)
    gaps = [abs(float((values - hits)[tenths == tenth].sum())) for tenth in range(10)]
    return sum(gaps) / max(values.size, 1)


def scores(truth: Sequence[Action], proposed: Sequence[Action | None]) -> tuple[float, float]:
    """Return the accuracy, and the recall averaged over the true labels."""
    right = np.array([t is p for t, p in zip(truth, proposed, strict=True)])
    true = np.array([str(t) for t in truth])
    recalls = [float(right[true == label].mean()) for label in np.unique(true)]
    return float(right.mean()), float(np.mean(recalls))


_MEASURES = {
    "acc.": "accuracy",
    "bal.": "balanced_accuracy",
    "calib.": "calibration_error",
    "angle": "angle_error",
    "corr.": "angle_correlation",
    "step": "angle_step",
    "learn ms": "learn_ms",
    "predict ms": "predict_ms",
}


def table(results: Sequence[Result]) -> Table:
    """Return a table with one row for each pair, learner and lesson. At the end of the table, each
    learner and lesson has one more row with the mean of each measure over all pairs, or the median
    of each time."""
    names = ("place", "train", "test", "learner", "lesson")
    rows: list[tuple[Cell, ...]] = [
        (*(r[name] for name in names), f"{r['correct']}/{r['frames']}", *_measures([r]))
        for r in results
    ]
    for learner, lesson in dict.fromkeys((r["learner"], r["lesson"]) for r in results):
        own = [r for r in results if (r["learner"], r["lesson"]) == (learner, lesson)]
        rows.append(("mean", "", "", learner, lesson, "", *_measures(own)))
    columns = (*names, "right", *_MEASURES)
    return Table(title="Taught on one drive, tested on another", columns=columns, rows=tuple(rows))


def _measures(results: Sequence[Result]) -> Iterator[str]:
    """Yield each measure of some results as text; an empty text if no result has the measure."""
    for name in _MEASURES.values():
        known = [r[name] for r in results if r[name] is not None]
        join = statistics.median if name.endswith("_ms") else statistics.fmean
        yield f"{join(known):.3f}" if known else ""
