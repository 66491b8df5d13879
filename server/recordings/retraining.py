"""Trains a new model from recordings in the background. A person then saves or drops this model."""

from __future__ import annotations

import contextlib
import threading
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from robot.clock import Clock, RealClock
from robot.errors import ConfigurationError
from robot.policy.policy import Policy
from robot.policy.registry import make_policy
from robot.recordings.comparison import Comparison, compare
from robot.recordings.edits import Notes
from robot.recordings.episode import open_episode
from robot.recordings.reading import reading
from robot.recordings.store import EpisodeStore
from robot.recordings.teaching import Report, count_steps, learn_again, plan
from robot.store.models.model import Model, take_model
from robot.types import DEFAULT_MOVES
from server.recordings.separate_process import SeparateWork

EditedPath = tuple[Path, Notes]
"""The first file of a recording, and its edits."""
_TOLD_EVERY_S = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Retrained:
    """The result of a training run."""

    report: Report
    comparison: Comparison | None
    model: Model


class Retraining:
    """Trains from recordings, one run at a time; the result stays until it is dropped."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._run: _Run | None = None

    def begin(self, store: EpisodeStore, episode_ids: Sequence[str], learner: str) -> None:
        """Begin to train an empty learner on these episodes, in the order of recording.

        Raises:
            ConfigurationError: If there is nothing to train on, or another run is in progress.
        """
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
        edited = [(episode.path, notes) for episode, notes in episodes]
        run = _Run(edited, learner, self._clock)
        with self._lock:
            if self._run is not None and self._run.is_running:
                raise ConfigurationError("another training run is in progress; drop it first")
            self._run = run
        self._clock.start_thread(run.work, "retraining")

    def take(self) -> Model:
        """Return the trained model; raises ConfigurationError if no run has finished."""
        run = self._run
        if run is None or run.model is None:
            raise ConfigurationError("no training run has finished yet")
        return run.model

    def drop(self) -> None:
        with self._lock:
            run, self._run = self._run, None
        if run is not None:
            run.drop()

    def describe(self) -> dict[str, Any]:
        run = self._run
        return {"state": "idle"} if run is None else run.describe()


class _Run:
    def __init__(self, episodes: list[EditedPath], learner: str, clock: Clock) -> None:
        self._episodes, self._learner, self._clock = episodes, learner, clock
        self._share = 0.0
        self._result: Retrained | None = None
        self._error: str | None = None
        self.is_running = True
        self._work: SeparateWork[float | Retrained] | None = None
        self._is_dropped = False

    @property
    def model(self) -> Model | None:
        return self._result.model if self._result else None

    def work(self) -> None:
        """Have a separate process do the run, and wait for it on this thread."""
        try:
            work = SeparateWork(retrain, self._episodes, self._learner, self._clock.wall_s())
            with reading([path for path, _ in self._episodes]), contextlib.closing(work):
                self._work = work
                for told in work:
                    if self._is_dropped:
                        return
                    if isinstance(told, Retrained):
                        self._result = told
                    else:
                        self._share = told
        except Exception as error:  # the learner of a plug-in may raise any error
            self._error = str(error) or type(error).__name__
        finally:
            self.is_running = False

    def drop(self) -> None:
        """End the run now, without a result."""
        self._is_dropped = True
        if self._work is not None:
            self._work.close()

    def describe(self) -> dict[str, Any]:
        result = self._result
        report = result.report if result else Report(taught=Counter())
        return {
            "state": "running" if self.is_running else "failed" if self._error else "done",
            "learner": self._learner,
            "episodes": [path.stem for path, _ in self._episodes],
            "share": self._share if self.is_running else 1.0,
            "error": self._error,
            "taught": report.taught,
            "missing_frames": report.missing_frames,
            "left_out_edits": report.left_out_edits,
            "comparison": asdict(result.comparison) if result and result.comparison else None,
        }


def retrain(
    tell: Callable[[float | Retrained], None],
    edited: Sequence[EditedPath],
    learner: str,
    wall_s: float,
) -> None:
    """Compare learners on the recordings, then train an empty learner on all recordings.

    `tell` is called with the share of the work that is done, and at the end with the result.
    """
    episodes = [(open_episode(path), notes) for path, notes in edited]
    unedited = [(episode, Notes()) for episode, _ in episodes]
    # Use the largest possible number of steps as the total, so that the progress never goes
    # backward.
    total = max(count_steps(unedited) + 2 * count_steps(episodes), 1)
    moves = tuple(dict.fromkeys(move for episode, _ in episodes for move in episode.moves))
    clock, done, told_s = RealClock(), 0, -_TOLD_EVERY_S

    def count() -> None:
        nonlocal done, told_s
        done += 1
        if (now_s := clock.now_s()) >= told_s + _TOLD_EVERY_S:
            told_s = now_s
            tell(min(1.0, done / total))

    def new_policy() -> Policy:
        return make_policy(learner, moves or DEFAULT_MOVES)

    comparison, policy = compare(episodes, new_policy, count), new_policy()
    report = learn_again(policy, episodes, on_step=count)
    model = take_model(policy, Counter(report.taught), saved_at_s=wall_s)
    tell(Retrained(report=report, comparison=comparison, model=model))
