"""Repeats the paper's figure 5: cycles per second on this machine, by number of nodes. A cycle
includes camera and motors."""

from __future__ import annotations

import contextlib
import platform
from collections.abc import Generator, Iterator
from itertools import cycle, islice

from robot.control.config import LoopConfig
from robot.control.loop import ControlLoop
from robot.devices.rig import Rig, build_rig
from robot.lab.experiment import Experiment, ExperimentSettings, Runs
from robot.lab.ideas import make_learner
from robot.lab.task import Params, Result, Task
from robot.lab.trial import PATIENT_LINK
from robot.policy.autosize import sample_frames
from robot.simulator.camera import SimCamera
from robot.simulator.driver import SimDriver
from robot.study.table import Cell, Table
from robot.types import DEFAULT_MOVES, Action, Mode, PilotCommand

NODES = (2, 4, 8, 16, 32, 64, 128)
KINDS = ("published", "default")
PUBLISHED = {
    "published-2": (14.90, 12.16),
    "published-4": (14.52, 9.61),
    "published-8": (13.24, 6.59),
    "published-16": (11.26, 4.03),
    "published-32": (7.13, 2.33),
    "published-64": (4.0, 1.57),
}
"""The paper's results: cycles a second on the EV3 while learning, and while applying."""
_COLUMNS = ("learning", "applying", "paper (EV3) learning", "paper (EV3) applying")


def _plan(settings: ExperimentSettings) -> Iterator[Task]:
    for learner in settings.learners or [f"{kind}-{n}" for kind in KINDS for n in NODES]:
        params = {
            "learner": learner,
            "robot": settings.robot,
            "cycles": 100 if settings.quick else 600,
            "machine": platform.node(),
        }
        yield Task(run_cycles, params)


def _tables(runs: Runs) -> list[Table]:
    rows: list[tuple[Cell, ...]] = []
    for task, result in runs:
        learner, timing = task.params["learner"], result["timing"]
        hz = (timing["learning_hz"], timing["applying_hz"])
        rows.append((learner, *hz, *PUBLISHED.get(learner, (None, None))))
    title = f"Cycles a second, robot {runs[0][0].params['robot']}"
    return [Table(title=title, columns=("learner", *_COLUMNS), rows=tuple(rows))]


def run_cycles(params: Params) -> Result:
    """Measure cycles a second while learning and while applying, on this machine.

    Parameters: `learner`; `robot` (`sim` runs as fast as possible; any other robot runs at the pace
    of its camera); `cycles` (number of timed cycles). The learner is filled to its maximum number
    of nodes first.
    """
    policy = make_learner(params["learner"], DEFAULT_MOVES)
    frames = sample_frames(policy.max_nodes + 8)
    for frame, move in zip(frames, cycle(DEFAULT_MOVES), strict=False):
        policy.learn(policy.extract(frame), move)
    is_simulated = params["robot"] == "sim"
    options = {"world": "office"} if is_simulated else params.get("options", {})
    rig = build_rig(params["robot"], options=options)
    loop = ControlLoop(rig.driver, rig.camera, policy, rig.clock, LoopConfig(governor=PATIENT_LINK))
    with contextlib.closing(_pictures(rig, loop)) as pictures:
        learning_hz = _measure(loop, pictures, Mode.TRAIN, Action.LEFT, params["cycles"])
        applying_hz = _measure(loop, pictures, Mode.AUTONOMOUS, None, params["cycles"])
    hz = {"learning_hz": learning_hz, "applying_hz": applying_hz}
    return {"timing": {**hz, "nodes": policy.n_nodes}}


def _pictures(rig: Rig, loop: ControlLoop) -> Generator[int]:
    """Yield the number of each new picture. Put a real robot on a stand first, because its wheels
    turn during the measurement."""
    driver, camera, last = rig.driver, rig.camera, 0
    if isinstance(driver, SimDriver) and isinstance(camera, SimCamera):
        driver.connect()
        with contextlib.closing(driver.simulation):
            while True:
                driver.advance(0.1)
                yield camera.capture().frame_id
    with driver, camera:
        while True:
            while (frame := camera.latest()) is None or frame.frame_id == last:
                if not rig.clock.wait(loop.wake, 5.0):
                    raise TimeoutError("the camera gives no pictures")
                loop.wake.clear()
            last = frame.frame_id
            yield last


def _measure(
    loop: ControlLoop, pictures: Iterator[int], mode: Mode, held: Action | None, cycles: int
) -> float:
    clock = loop.clock
    next(pictures)
    loop.set_mode(mode)
    loop.tick(clock.now_s())
    started_s = clock.now_s()
    for seq, frame_id in enumerate(islice(pictures, cycles)):
        now_s = clock.now_s()
        loop.command(PilotCommand(held=held, frame_id=frame_id, seq=seq, received_s=now_s))
        loop.tick(now_s)
    return cycles / (clock.now_s() - started_s)


FIGURE5 = Experiment(
    title="Figure 5: speed",
    text="In a cycle the robot takes a picture, computes its features, decides and drives; while "
    "learning, it also learns an example. All nodes are in use before the measurement begins. In "
    "the simulator a cycle also renders the picture and moves the world; a real robot (--robot) "
    "waits for its camera, as in the paper. The runs are made one at a time for any --jobs.",
    plan=_plan,
    tables=_tables,
    drawn=_COLUMNS,
    times_machine=True,
)
