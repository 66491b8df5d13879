"""One robot's guided study: the run in progress, and the results of earlier ones."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from robot.clock import Clock
from robot.control.loop import ControlLoop
from robot.control.state import Tick
from robot.errors import ConfigurationError, NotFoundError, RecordingError
from robot.lab.protocol import TRIALS, Phase, StudyRun
from robot.store.folder import write_whole
from robot.types import Action, Mode, StartStop

_RESULT = re.compile(r"\d{8}-\d{6}-trial-[1-3]")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialModels:
    """The model of the trial in progress, and the model in use before it."""

    own: str
    before: str | None
    moves_before: tuple[Action, ...]


def name_of_world(body: object) -> str | None:
    """Return the world of a simulated body, None for a real one.

    By attribute, not by class: a server on a brick never imports the simulation.
    """
    return cast(str, body.simulation.world.name) if hasattr(body, "simulation") else None


def check_world(body: object, trial: int) -> None:
    """Refuse a trial in the wrong simulated world; the place of a real robot is unknown.

    Raises:
        ConfigurationError: If the robot is simulated, in another world.
    """
    place, here = TRIALS[trial][0], name_of_world(body)
    if here not in (None, place):
        raise ConfigurationError(
            f"trial {trial} is driven in the world {place!r}, and this is {here!r}; "
            f"start the simulator with --world {place}"
        )


class Study(StartStop):
    """Follows the control loop during a study run, while its context is open.

    `pace` is how many seconds of a run pass in one second: 1 except in demonstrations and tests.
    """

    def __init__(
        self,
        loop: ControlLoop,
        clock: Clock,
        announce: Callable[..., None],
        episode: Callable[[], str | None] = lambda: None,
    ) -> None:
        self.pace = 1.0
        self.lesson: StudyRun | None = None
        self.result: dict[str, Any] | None = None
        self.models: TrialModels | None = None
        self._loop = loop
        self._clock = clock
        self._announce = announce
        self._episode = episode
        self._began_s = 0.0
        self._episodes: list[str] = []
        self._unsubscribe: Callable[[], None] = lambda: None

    def start(self) -> None:
        """Subscribe to the control loop."""
        self._unsubscribe = self._loop.subscribe(self.note)

    def stop(self) -> None:
        """Unsubscribe."""
        self._unsubscribe()

    def note(self, tick: Tick) -> None:
        """Record one tick, on the loop's thread; stop the robot when a phase ends."""
        lesson = self.lesson
        if lesson is None or lesson.mode is None:
            return
        episode = self._episode()
        if episode is not None and episode not in self._episodes:
            self._episodes.append(episode)
        if lesson.note(tick):
            self._loop.set_mode(Mode.STOPPED)
            self._announce("lesson", phase=lesson.phase.value)

    def begin(self, trial: int, teach_s: int) -> StudyRun:
        """Start a run, in place of one in progress."""
        self.lesson = StudyRun(trial, teach_s, self.pace)
        self.result, self._episodes, self._began_s = None, [], self._clock.wall_s()
        return self.lesson

    def abandon(self) -> TrialModels | None:
        """End the trial; if it was not finished, return its models to restore."""
        is_done = self.lesson is None or self.lesson.phase is Phase.DONE
        models, self.models = self.models, None
        self.lesson = self.result = None
        return None if is_done else models

    def judge(self, answer: int, folder: Path) -> dict[str, Any]:
        """Record the closing answer and save the result.

        Raises:
            ConfigurationError: If no run has reached its end, or the answer is not valid.
        """
        if self.lesson is None:
            raise ConfigurationError("no study run is in progress")
        self.lesson.judge(answer)
        began = time.strftime("%Y%m%d-%H%M%S", time.localtime(self._began_s))
        self.result = {
            "id": f"{began}-trial-{self.lesson.trial}",
            "began_at_s": round(self._began_s, 1),
            "learner": self._loop.state.learner,
            "lessons": sum(self._loop.state.taught.values()),
            "episodes": self._episodes,
            **self.lesson.result(),
        }
        folder.mkdir(parents=True, exist_ok=True)
        text = json.dumps(self.result, allow_nan=False)
        write_whole(folder / f"{self.result['id']}.json", text.encode())
        return self.result

    def describe(self) -> dict[str, Any] | None:
        """Return the run in progress as the page gets it; None if there is none."""
        lesson = self.lesson
        if lesson is None:
            return None
        return {
            "trial": lesson.trial,
            "place": lesson.place,
            "phase": lesson.phase.value,
            "mode": lesson.mode.value if lesson.mode else None,
            "left_s": round(lesson.left_s, 1),
            "wanted_s": {phase.value: s for phase, s in lesson.wanted_s.items()},
            "done_s": {phase.value: round(s, 1) for phase, s in lesson.done_s.items()},
            "interventions": lesson.interventions,
            "result": self.result if lesson.phase is Phase.DONE else None,
        }


def list_results(folder: Path) -> list[dict[str, Any]]:
    """Summarize each saved result, the newest first; unreadable ones are left out."""
    lines = []
    for file in sorted(folder.glob("*.json"), reverse=True):
        try:
            result = json.loads(file.read_bytes())
            fields = ("id", "began_at_s", "trial", "ssd", "answer")
            lines.append({name: result[name] for name in fields})
        except (ValueError, KeyError, TypeError):
            continue
    return lines


def read_result(folder: Path, result_id: str) -> bytes:
    """Return the file of one result.

    Raises:
        NotFoundError: If the result is unknown.
        RecordingError: If it cannot be read.
    """
    if not _RESULT.fullmatch(result_id) or not (folder / f"{result_id}.json").is_file():
        raise NotFoundError(f"unknown study result {result_id!r}")
    try:
        return (folder / f"{result_id}.json").read_bytes()
    except OSError as error:
        raise RecordingError(f"the study result {result_id!r} cannot be read: {error}") from error
