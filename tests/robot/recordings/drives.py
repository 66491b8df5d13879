"""Recorded drives on the test bench, for tests of their readers."""

from __future__ import annotations

import atexit
import itertools
import shutil
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

from robot.recordings.episode import Episode, open_episode
from robot.recordings.queue import RecorderConfig
from robot.recordings.recorder import Recorder
from robot.types import Action, Mode
from tests.robot.bench_robot import BenchRobot

MOVES = (Action.FORWARD, Action.LEFT, Action.RIGHT)


_BEGINNINGS_S = itertools.count(1_700_000_000, 60)
"""Each drive begins a minute after the previous one."""


class RecordedBench(BenchRobot):
    """A bench robot whose runs are recorded; only the test advances time."""

    def __init__(
        self,
        folder: Path,
        learner: str = "published-8",
        config: RecorderConfig | None = None,
        **more: Any,
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
            config=config or RecorderConfig(spare_bytes=0),
            **more,
        )
        self.recorder.start()
        self.tick()

    def drive(self, scenes: range, mode: Mode = Mode.TRAIN) -> None:
        """Drive through scenes, hold one direction after the other, and stop."""
        self.start(mode, scenes.start)
        for scene in scenes:
            self.step(scene, MOVES[scene // 4 % 3])
        self.stop()

    def stop(self) -> None:
        self.loop.set_mode(Mode.STOPPED)
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


def record_drive(folder: Path, learner: str = "published-8", frames: int = 60) -> Episode:
    """Record one drive and open it.

    The first one of a folder is a copy, because recording takes longer than most tests.
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
