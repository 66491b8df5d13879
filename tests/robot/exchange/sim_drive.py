"""A short recorded lesson in the simulator: a pilot who turns left before walls."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from robot.control.loop import ControlLoop
from robot.learner.base import State
from robot.policy.registry import make_policy
from robot.policy.undo import undo_examples
from robot.recordings.config import RecorderConfig
from robot.recordings.recorder import Recorder
from robot.simulator.camera import SimCamera, SimCameraOptions
from robot.simulator.driver import SimDriver, SimOptions
from robot.testing import VirtualClock
from robot.types import Action, Mode, PilotCommand

STEP_S = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Driven:
    """The results of the lesson: the recording, and the learner at its end."""

    path: Path
    state: State
    lessons: int


def drive_in_simulator(folder: Path, learner: str, steps: int = 200, undo_s: float = 0.0) -> Driven:
    """Teach for some seconds, then correct the robot from time to time while it drives by
    itself."""
    clock, driver = VirtualClock(50.0), SimDriver(SimOptions())
    camera = SimCamera(driver, SimCameraOptions(), clock)
    loop = ControlLoop(driver, camera, make_policy(learner), clock)
    config = RecorderConfig(spare_bytes=0)
    recorder = Recorder(loop, folder, robot="sim", options={"world": "box"}, config=config)
    recorder.start()
    driver.connect()
    try:
        camera.capture()
        loop.tick(clock.now_s())
        for step in range(1, steps + 1):
            if step in (1, steps // 2):
                loop.set_mode(Mode.TRAIN if step == 1 else Mode.AUTONOMOUS)
            clock.sleep(STEP_S)
            driver.advance(STEP_S)
            frame, now_s = camera.capture(), clock.now_s()
            loop.tick(now_s)
            is_near = (driver.sense().distance_m or 9.0) < 0.35
            wanted = Action.LEFT if is_near or step % 23 < 6 else Action.FORWARD
            is_alone = step >= steps // 2 and step % 20 > 7
            loop.command(
                PilotCommand(
                    held=None if is_alone else wanted,
                    frame_id=frame.frame_id,
                    seq=step,
                    received_s=now_s,
                )
            )
            loop.tick(now_s)
        if undo_s:
            loop.submit(lambda: undo_examples(loop.history, undo_s))
        loop.set_mode(Mode.STOPPED)
        loop.tick(clock.now_s())
        recorder.finish()
        recorder.stop()
    finally:
        driver.disconnect()
        driver.simulation.close()
    [path] = folder.glob("*.mcap")
    taught = loop.history.taught.total()
    return Driven(path=path, state=loop.history.policy.get_state(), lessons=taught)
