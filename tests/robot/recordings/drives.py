"""Recorded drives on the test bench, for tests of their readers."""

from __future__ import annotations

import atexit
import itertools
import shutil
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO

from robot.policy.undo import undo_examples
from robot.recordings.config import RecorderConfig
from robot.recordings.editing import moments
from robot.recordings.edits import Notes
from robot.recordings.episode import Episode, open_episode, taught_frames
from robot.recordings.messages import Topic
from robot.recordings.recorder import Recorder
from robot.types import Action, Mode
from tests.robot.bench_robot import BenchRobot

MOVES = (Action.FORWARD, Action.LEFT, Action.RIGHT)
_BEGINNINGS_S = itertools.count(1_700_000_000, 60)
"""Each drive begins a minute after the previous one."""


class RecordedBench(BenchRobot):
    """A bench robot whose runs are recorded; `limits` are fields of the recorder's configuration.

    Only the test advances time."""

    def __init__(
        self,
        folder: Path,
        learner: str = "published-8",
        open_file: Callable[[Path], BinaryIO] = lambda path: path.open("xb"),
        **limits: Any,
    ) -> None:
        super().__init__(learner)
        self.clock.set_wall(next(_BEGINNINGS_S))
        self.folder = folder
        self.told: list[tuple[str, dict[str, Any]]] = []
        self.recorder = Recorder(
            self.loop,
            folder,
            robot="bench",
            options={"world": "bench"},
            announce=lambda name, **fields: self.told.append((name, fields)),
            config=RecorderConfig(**{"spare_bytes": 0, **limits}),
            open_file=open_file,
        )
        self.recorder.start()
        self.tick()

    def drive(self, scenes: range, mode: Mode = Mode.TRAIN) -> None:
        """Drive through scenes, hold one direction after the other to teach, and stop."""
        self.start(mode, scenes.start)
        for scene in scenes:
            self.step(scene, MOVES[scene // 4 % 3] if mode is Mode.TRAIN else None)
        self.stop()

    def stop(self) -> None:
        self.loop.set_mode(Mode.STOPPED)
        self.tick()

    def undo(self, seconds: float) -> None:
        self.loop.submit(lambda: undo_examples(self.loop.history, seconds))
        self.tick()

    def stand(self, seconds: float) -> None:
        """Let time pass without driving."""
        for _ in range(int(seconds / 0.5)):
            self.clock.sleep(0.5)
            self.camera.show(0)
            self.tick()

    def finish(self) -> list[Path]:
        """End the recording and list the files."""
        self.recorder.finish()
        self.recorder.stop()
        return sorted(self.folder.glob("*.mcap"))

    def episode(self) -> Episode:
        """End the recording and open it."""
        return open_episode(self.finish()[-1])


def content(episode: Episode) -> dict[str, Any]:
    """Return a recording's content, for a comparison with another recording."""
    entries = episode.frames.items()
    return {
        "frames": [(i, e.captured_s, e.size, episode.frame(i).data) for i, e in entries],
        "events": [(at_s, repr(event)) for at_s, event in episode.events],
        "taught": dict(taught_frames(episode)),
        "moments": list(moments(episode, Notes())),
        "modes": list(episode.messages(Topic.MODE)),
        "results": episode.results,
        "span": (episode.start_s, episode.duration_s),
        "damage": episode.damage,
    }


def record_drive(folder: Path, learner: str = "published-8", frames: int = 60) -> Episode:
    """Record one drive and open it.

    The first recording of a folder is a copy, because recording takes longer than most tests.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if any(folder.iterdir()):
        return open_episode(_drive(folder, learner, frames))
    for file in _recorded(learner, frames).parent.iterdir():
        shutil.copy2(file, folder)
    return open_episode(folder / _recorded(learner, frames).name)


def _drive(folder: Path, learner: str, frames: int) -> Path:
    robot = RecordedBench(folder, learner)
    robot.drive(range(frames))
    return robot.finish()[-1]


@cache
def _recorded(learner: str, frames: int) -> Path:
    folder = tempfile.mkdtemp()
    atexit.register(shutil.rmtree, folder)
    return _drive(Path(folder), learner, frames)
