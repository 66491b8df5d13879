"""Training again from recordings, in the background; the result is then saved or dropped."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from robot.clock import Clock
from robot.errors import ConfigurationError
from robot.policy.policy import Policy
from robot.policy.registry import make_policy
from robot.recordings.comparison import Comparison, compare
from robot.recordings.edits import Notes
from robot.recordings.reading import reading
from robot.recordings.store import EpisodeStore
from robot.recordings.teaching import EditedEpisode, Report, count_steps, learn_again, plan
from robot.store.models.model import Model, take_model
from robot.types import DEFAULT_MOVES

_BREATH_S = 0.0005
"""Pause after each step, in seconds, so that the control loop's thread can run."""


class Retraining:
    """At most one run at a time; a run's result stays until it is dropped."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._run: _Run | None = None

    def begin(self, store: EpisodeStore, episode_ids: Sequence[str], learner: str) -> None:
        """Train an empty learner on these episodes in the order of recording; one run at a time."""
        if not episode_ids:
            raise ConfigurationError("choose at least one recording")
        episodes = [
            (store.open(episode_id), store.notes(episode_id))
            for episode_id in sorted(set(episode_ids))
        ]
        if next(plan(episodes), None) is None:
            raise ConfigurationError(
                "these recordings have no examples, or all of them were deleted"
            )
        run = _Run(episodes, learner, self._clock)
        with self._lock:
            if self._run is not None and self._run.is_running:
                raise ConfigurationError("another training run is in progress; drop it first")
            self._run = run
        self._clock.start_thread(run.work, "retraining")

    def take(self) -> Model:
        """Return the trained model; it stays until `drop`."""
        run = self._run
        if run is None or run.model is None:
            raise ConfigurationError("no training run has finished yet")
        return run.model

    def drop(self) -> None:
        with self._lock:
            run, self._run = self._run, None
        if run is not None:
            run.is_dropped = True

    def describe(self) -> dict[str, Any]:
        run = self._run
        return {"state": "idle"} if run is None else run.describe()


class _Run:
    def __init__(self, episodes: list[EditedEpisode], learner: str, clock: Clock) -> None:
        self._episodes, self._learner, self._clock = episodes, learner, clock
        unedited = [(episode, Notes()) for episode, _ in episodes]
        # The largest possible number of steps.
        self._total = count_steps(unedited) + 2 * count_steps(episodes)
        self._done = 0
        self._report = Report(taught=Counter())
        self._comparison: Comparison | None = None
        self._error: str | None = None
        self.is_running = True
        self.is_dropped = False
        self.model: Model | None = None

    def work(self) -> None:
        """Compare, then train on everything; on a separate thread."""
        try:
            with reading([episode.path for episode, _ in self._episodes]):
                self._comparison = compare(self._episodes, self._new_policy, self._step)
                policy = self._new_policy()
                self._report = learn_again(policy, self._episodes, on_step=self._step)
            taught = Counter(self._report.taught)
            self.model = take_model(policy, taught, saved_at_s=self._clock.wall_s())
        except Exception as error:  # a plug-in's learner may raise anything
            self._error = str(error) or type(error).__name__
        finally:
            self.is_running = False

    def _new_policy(self) -> Policy:
        moves = tuple(dict.fromkeys(move for e, _ in self._episodes for move in e.moves))
        return make_policy(self._learner, moves or DEFAULT_MOVES)

    def _step(self) -> None:
        self._done += 1
        self._clock.sleep(_BREATH_S)
        if self.is_dropped:
            raise RuntimeError("dropped")  # this ends the thread; nobody reads the error

    def describe(self) -> dict[str, Any]:
        state = "running" if self.is_running else "failed" if self._error else "done"
        return {
            "state": state,
            "learner": self._learner,
            "episodes": [episode.id for episode, _ in self._episodes],
            "share": min(1.0, self._done / max(self._total, 1)) if self.is_running else 1.0,
            "error": self._error,
            "taught": self._report.taught,
            "missing_frames": self._report.missing_frames,
            "left_out_edits": self._report.left_out_edits,
            "comparison": asdict(self._comparison) if self._comparison else None,
        }
