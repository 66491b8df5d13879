"""One simulated trial, faster than real time, through the real control loop.

The paper's trials have three phases: teaching, driving with corrections, driving unaided. A
simulated pilot sends commands like a phone; `ControlLoop.tick` decides, drives and learns.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from robot.control.config import LinkGovernorConfig, LoopConfig
from robot.control.loop import ControlLoop
from robot.driver import Pose, Sensors
from robot.errors import RobotError
from robot.lab.metrics import DriveLog, DriveSample
from robot.lab.simulated_pilots.pilot import SimulatedPilot
from robot.lab.simulated_pilots.situation import Situation, observe
from robot.policy.policy import Policy
from robot.simulator.camera import SimCamera, SimCameraOptions
from robot.simulator.driver import SimDriver, SimOptions
from robot.testing import VirtualClock
from robot.types import Action, DrivenBy, Mode, Prediction, StartStop

FRAME_RATE_HZ = 10.0
"""Default number of frames, ticks and heartbeats per second: about the paper's cycle rate with 32
nodes."""
PATIENT_LINK = LinkGovernorConfig(warn_s=10.0, cap_speed_s=10.0, stop_learning_s=10.0, stop_s=10.0)
"""Limits of the link governor for old pictures. They are so high that even a busy machine does not
reach them, because delays must not affect an experiment."""


class Trial(StartStop):
    """A simulated robot, its loop and its pilot, on a clock that runs as fast as the machine can.

    A trial is a context manager, which closes the simulator's renderer at the end.

    Args:
        rate_hz: Frames, ticks and heartbeats per second.
        drift: The drift of the wheels while the pilot teaches (`Simulation.drift_share`).

    Attributes:
        timing: After the trial: the number of pictures, and the pictures per second of real time.
    """

    timing: dict[str, float]

    def __init__(
        self,
        world: str,
        seed: int,
        policy: Policy,
        pilot: SimulatedPilot,
        *,
        rate_hz: float = FRAME_RATE_HZ,
        drift: float = 0.0,
    ) -> None:
        self.clock = VirtualClock()
        self.rate_hz, self.drift = rate_hz, drift
        self.driver = SimDriver(SimOptions(world=world, seed=seed))
        self.camera = SimCamera(self.driver, SimCameraOptions(), self.clock)
        self.policy, self.pilot = policy, pilot
        self._frames, self._started_s = 0, time.perf_counter()
        self.loop = ControlLoop(
            self.driver, self.camera, policy, self.clock, LoopConfig(governor=PATIENT_LINK)
        )

    def drive(
        self,
        mode: Mode,
        seconds: float,
        *,
        supervised: bool = True,
        until: Callable[[DriveSample], bool] | None = None,
    ) -> DriveLog:
        """Drive for a while in one mode, and return the log.

        Args:
            mode: In TRAIN the pilot drives, in AUTONOMOUS the robot.
            supervised: False if the pilot only watches and never takes the wheel.
            until: Called after each tick; the drive ends early when it returns True.

        Raises:
            Exception: If the learner raised an error, because all later results would be
                meaningless.
            RobotError: If the loop stopped by itself, because the experiment is then invalid.
        """
        log = DriveLog()
        self.driver.simulation.drift_share = self.drift if mode is Mode.TRAIN else 0.0
        self.pilot.change_mode(mode if supervised else Mode.STOPPED)
        self.loop.set_mode(Mode.STOPPED)
        self._turn()
        self.loop.set_mode(mode)
        for _ in range(round(seconds * self.rate_hz)):
            log.append(self._turn())
            state = self.loop.state
            if (error := self.loop.learning.error or self.loop.error) is not None:
                raise error
            if state.decision.mode is Mode.STOPPED:
                why = state.fault or state.decision.stop_reason
                raise RobotError(f"the robot stopped at {self.clock.now_s():.1f} s: {why}")
            if until is not None and until(log[-1]):
                break
        return log

    def lesson(
        self, teach_s: float, correct_s: float, alone_s: float
    ) -> tuple[DriveLog, dict[str, DriveLog]]:
        """Teach the robot, then let it drive unaided; if `correct_s` is not 0, correct it, and let
        it drive unaided again.

        Returns the log of the teaching, and the logs of the unaided drives `before` and `after` the
        corrections.
        """
        taught = self.drive(Mode.TRAIN, teach_s)
        alone = {"before": self.drive(Mode.AUTONOMOUS, alone_s, supervised=False)}
        if correct_s:
            self.drive(Mode.AUTONOMOUS, correct_s)
            alone["after"] = self.drive(Mode.AUTONOMOUS, alone_s, supervised=False)
        return taught, alone

    def _turn(self) -> DriveSample:
        """Advance by one frame, show it to the pilot, and tick the loop."""
        self.clock.advance(1 / self.rate_hz)
        self.driver.advance(1 / self.rate_hz)
        frame = self.camera.capture()
        self._frames += 1
        now_s = self.clock.now_s()
        situation = observe(self.driver.simulation, frame.frame_id, now_s)
        self.loop.command(self.pilot.act(situation, _action_of(self.loop.state.prediction)))
        tick = self.loop.tick(now_s)
        said = tick.commands[-1] if tick.commands else None
        return _sample(
            self.driver,
            situation,
            tick.sensors,
            action=tick.sent,
            driven_by=tick.decision.driven_by,
            point=tick.decision.point,
            asks_pilot=tick.decision.asks_pilot,
            proposed=_action_of(tick.prediction),
            wanted=said.held if said is not None else None,
        )

    def start(self) -> None:
        self.driver.connect()

    def stop(self) -> None:
        seconds = time.perf_counter() - self._started_s
        self.timing = {"frames": self._frames, "frames_per_s": self._frames / seconds}
        self.driver.disconnect()
        self.driver.simulation.close()


def drive_by_hand(
    world: str,
    seed: int,
    pilot: SimulatedPilot,
    seconds: float,
    rate_hz: float,
    *,
    start: Pose | None = None,
    watching: Policy | None = None,
) -> DriveLog:
    """Let a pilot drive without a loop, and return the log.

    The policy `watching` proposes a move for each picture. The pilot sees the proposals on the
    screen, but the policy learns nothing.
    """
    log, clock = DriveLog(), VirtualClock()
    driver = SimDriver(SimOptions(world=world, seed=seed))
    camera = SimCamera(driver, SimCameraOptions(), clock)
    driver.connect()
    driver.simulation.pose = start or driver.simulation.pose
    pilot.change_mode(Mode.TRAIN)
    for frame_id in range(1, round(seconds * rate_hz) + 1):
        clock.advance(1 / rate_hz)
        driver.advance(1 / rate_hz)
        now_s = clock.now_s()
        situation = observe(driver.simulation, frame_id, now_s)
        would: Action | None = None
        if watching is not None:
            x = watching.extract(camera.capture())
            would = watching.propose(frame_id, x, at_s=now_s).action
        command = pilot.act(situation, would)
        if command.point is not None:
            driver.send_point(command.point)
        else:
            driver.send_action(command.held or Action.STOP)
        log.append(
            _sample(
                driver,
                situation,
                driver.sense(),
                action=driver.simulation.action,
                point=driver.simulation.point,
                driven_by=DrivenBy.PILOT,
                proposed=would,
                wanted=command.held,
            )
        )
    driver.disconnect()
    driver.simulation.close()
    return log


def _sample(
    driver: SimDriver, situation: Situation, sensors: Sensors, **decided: Any
) -> DriveSample:
    return DriveSample(
        now_s=situation.at_s,
        distance_m=sensors.distance_m or 0.0,
        pose=situation.pose,
        is_touching=driver.simulation.is_touching,
        is_pushing=driver.simulation.is_pushing,
        situation=situation,
        **decided,
    )


def _action_of(prediction: Prediction | None) -> Action | None:
    return prediction.action if prediction is not None else None
