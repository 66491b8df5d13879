"""Chooses `max_nodes`: the number of nodes that this machine can handle at a given frame rate."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from statistics import median

import numpy as np

from robot.clock import RealClock
from robot.errors import ConfigurationError
from robot.policy.registry import make_policy
from robot.types import DEFAULT_MOVES, Encoding, Frame

_MACHINE = RealClock()

SIZES = (2, 4, 8, 16, 32, 64, 128, 256, 512, 1024)
MARGIN = 0.5
"""Share of the time per frame that features and learner may use; other parts need the rest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """The times of one policy at one size, in seconds; each step was measured several times."""

    max_nodes: int
    extract_s: Sequence[float]
    propose_s: Sequence[float]
    learn_s: Sequence[float]

    @property
    def frame_s(self) -> float:
        """Typical time for one taught frame: the sum of the medians. `MARGIN` reserves time for
        ticks that are slowed down by other tasks of the machine."""
        return sum(map(median, (self.extract_s, self.propose_s, self.learn_s)))


def sample_frames(count: int) -> list[Frame]:
    """Return synthetic frames of one drive: coarse, noisy scenes that scroll past."""
    rng = np.random.default_rng(0)
    panorama = np.kron(rng.integers(30, 220, (12, 160)), np.ones((10, 10)))
    frames = []
    for i in range(count):
        left = (i * 7) % 1440
        grey = panorama[:, left : left + 160] + rng.normal(0.0, 4.0, (120, 160))
        yuyv = np.stack([grey.clip(0, 255), np.full((120, 160), 128.0)], axis=2).astype(np.uint8)
        frames.append(
            Frame(
                frame_id=i + 1,
                captured_s=i / 30,
                width=160,
                height=120,
                encoding=Encoding.YUYV,
                data=yuyv.tobytes(),
            )
        )
    return frames


def measure(
    max_nodes: int,
    *,
    kind: str = "default",
    repeats: int = 60,
    frames: Sequence[Frame] | None = None,
) -> Cost:
    """Measure the times of a full learner of this size on this machine."""
    policy = make_policy(f"{kind}-{max_nodes}")
    frames = sample_frames(60) if frames is None else frames
    extract = times(lambda i: policy.extract(frames[i % len(frames)]), min(repeats, 20))
    xs = [policy.extract(frame) for frame in frames]
    rng = np.random.default_rng(0)
    noise = rng.integers(-8, 9, (max_nodes + repeats, xs[0].size), np.int16)  # no view twice
    views = [(xs[i % len(xs)] + noise[i]).clip(0, 255).astype(np.uint8) for i in range(len(noise))]
    for i in range(max_nodes):  # fill the learner first, because a full learner is slower
        policy.learn(views[i], DEFAULT_MOVES[i % 3])
    propose = times(lambda i: policy.propose(i, xs[i % len(xs)]), repeats)
    learn = times(lambda i: policy.learn(views[max_nodes + i], DEFAULT_MOVES[i % 3]), repeats)
    return Cost(max_nodes=max_nodes, extract_s=extract, propose_s=propose, learn_s=learn)


def choose_max_nodes(
    rate_hz: float,
    *,
    kind: str = "default",
    cost_of: Callable[[int], Cost] | None = None,
) -> Cost:
    """Return the cost of the largest size in `SIZES` that reaches the rate with a margin.

    Sizes are tried in ascending order, and the search ends at the first size that is too slow, so
    a slow machine wastes no time on sizes that it cannot run.

    Raises:
        ConfigurationError: If even the smallest size is too slow.
    """
    if not rate_hz > 0:
        raise ConfigurationError(f"the frame rate must be above 0, not {rate_hz}")
    cost_of = cost_of or partial(measure, kind=kind, frames=sample_frames(60))
    best = None
    for size in SIZES:
        cost = cost_of(size)
        if cost.frame_s > MARGIN / rate_hz:
            break
        best = cost
    if best is None:
        raise ConfigurationError(
            f"this machine is too slow for {rate_hz:g} frames a second even with {SIZES[0]} nodes; "
            "choose a lower --rate"
        )
    return best


def times(step: Callable[[int], object], repeats: int) -> list[float]:
    """Return the duration of each step, in seconds."""
    took_s = []
    for i in range(repeats):
        start_s = _MACHINE.now_s()
        step(i)
        took_s.append(_MACHINE.now_s() - start_s)
    return took_s
