"""Cuts the power of a robot at random moments, many times on one data folder.

    python -m tests.robot.recordings.power_cut FOLDER [KILLS] [SEED]

Each time a process starts on the same folder (and loads the last model), is driven and taught in
real time, and is killed with SIGKILL. Its reports until then are compared with the content of the
disk. Processes are forked, so that a start costs milliseconds. Prints JSON.
"""

from __future__ import annotations

import json
import os
import random
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path

from robot.clock import RealClock
from robot.control.state import Tick
from robot.devices.rig import Rig
from robot.errors import RobotError
from robot.policy.events import Taught
from robot.policy.registry import make_policy
from robot.recordings.config import RecorderConfig
from robot.recordings.episode import open_episode, taught_frames
from robot.store.folder import Storage
from robot.testing import FakeCamera, FakeDriver
from robot.types import Action, Mode, PilotCommand
from server.persistence import Persistence
from server.recordings.part import Recordings

LONGEST_LIFE_S = 0.8
MOMENTS = ("start", "loaded", "tick", "kept")
"""The event from which a life is counted: on a busy machine the start would take longer than the
life."""
UNDONE_S = 0.2


@dataclass(slots=True)
class Life:
    """The reports of one process, and whether what it left can be read."""

    loaded: int | None = None
    """Lessons that the learner had at the start."""
    told: list[int] = field(default_factory=list)
    """Number of lessons of the learner after each tick."""
    kept: int = 0
    """Number of these that were in the journal."""
    taught_on_disk: int = 0
    failure: str | None = None


def live(folder: Path, out: int, wall_s: float) -> None:
    """Run a robot until the power is cut. Each printed line reports something that has happened."""

    def tell(kind: str, *values: object) -> None:
        nonlocal n_told
        n_told += kind == "tick"
        os.write(out, (" ".join([kind, *map(str, values)]) + "\n").encode())

    n_told = n_queued = n_waited = 0
    is_loaded = False
    tell("start")

    def note(tick: Tick) -> None:
        if is_loaded and (tick.decision.mode is not Mode.STOPPED or tick.history_events):
            taught = sum(isinstance(event, Taught) for event in tick.history_events)
            for left in range(max(taught - 1, 0), -1, -1):  # each is a separate record
                tell("tick", rig.loop.history.taught.total() - left)

    def note_queued(tick: Tick) -> None:
        nonlocal n_queued
        n_queued = n_told

    def tell_kept() -> None:
        """Report, at the end of a turn of the journal, what waited before that turn."""
        nonlocal n_waited
        if n_waited:
            tell("kept", n_waited)
        n_waited = n_queued

    def undo() -> None:
        """Report the result of an undo before it is done, because the power may be cut before the
        next tick."""
        history = rig.loop.history
        tell("tick", history.taught.total() - len(history.last_examples(UNDONE_S)))
        history.undo(UNDONE_S)

    clock = RealClock()
    clock.wall_s = lambda: wall_s  # type: ignore[method-assign]
    rig = Rig(FakeDriver(), FakeCamera(clock), make_policy("published-8"), clock)
    persistence = Persistence(Storage(folder), rig, name="bench")
    persistence.part(Recordings).recorder.recording._config = RecorderConfig(spare_bytes=0)
    rig.loop.subscribe(note)  # first, so that everything on the disk was reported before
    with rig:
        persistence.writer._thread.add(tell_kept)
        persistence.start()
        # Last, because the counted records are queued for the disk already.
        rig.loop.subscribe(note_queued)
        persistence.autosave.load_last()
        tell("loaded", rig.loop.submit(lambda: rig.loop.history.taught.total()).result())
        is_loaded = True
        drive(rig, undo)


def drive(rig: Rig, undo: Callable[[], object]) -> None:
    """Teach forever, change the mode six times a second, and sometimes undo the last seconds."""
    seq = 0
    while True:
        rig.loop.set_mode((Mode.TRAIN, Mode.AUTONOMOUS)[seq // 8 % 2])
        for _ in range(8):
            seq += 1
            frame_id = rig.loop.state.frame_id
            held = (Action.LEFT, Action.FORWARD)[seq // 3 % 2]
            now_s = rig.clock.now_s()
            rig.loop.command(PilotCommand(held=held, frame_id=frame_id, seq=seq, received_s=now_s))
            time.sleep(0.02)
        if seq % 24 == 0:
            rig.loop.submit(undo)


def cut(folder: Path, moment: str, life_s: float, wall_s: float) -> Life:
    """Start a robot, kill it `life_s` after a reported moment, and compare."""
    before = set(folder.glob("episodes/*.mcap"))
    read_end, write_end = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(read_end)
        try:
            live(folder, write_end, wall_s)
        except BaseException as error:  # reported to the parent, which counts it
            os.write(write_end, f"failed {error!r}\n".encode())
        os._exit(1)
    os.close(write_end)
    lines = []
    with os.fdopen(read_end) as file:
        for line in file:
            lines.append(line)
            if line.startswith(moment):
                break
        time.sleep(life_s)
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        lines += file.readlines()
    life = Life()
    for kind, _, rest in (line.strip().partition(" ") for line in lines):
        if kind == "failed":
            life.failure = rest
        elif kind == "loaded":
            life.loaded = int(rest)
        elif kind == "kept":
            life.kept = int(rest)
        elif kind == "tick":
            life.told.append(int(rest))
    for path in set(folder.glob("episodes/*.mcap")) - before:
        if path.stat().st_size:  # killed between the creation of the file and its first flush
            try:
                life.taught_on_disk += len(taught_frames(open_episode(path)))
            except RobotError as error:
                life.failure = str(error)
    return life


def main() -> None:
    folder, kills, seed = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    rng = random.Random(seed)
    lives = []
    for number in range(kills):
        wall_s = 1.7e9 + rng.uniform(-60, 60) * 86_400  # a clock that is set to any time
        moment, life_s = rng.choice(MOMENTS), rng.uniform(0.0, LONGEST_LIFE_S)
        if number == 0:  # one life in which something is taught, on a slow machine as well
            moment, life_s = "kept", 2 * LONGEST_LIFE_S
        lives.append(cut(folder, moment, life_s, wall_s))
    print(json.dumps([asdict(life) for life in lives]))


if __name__ == "__main__":
    main()
