"""One simulated trial, faster than real time, through the real control loop.

Teaching, driving alone, driving with corrections: the phases of the paper's trials. A simulated
pilot holds directions as a phone would; `ControlLoop.tick` decides, drives and learns.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from robot.control.link_governor import LinkGovernorConfig
from robot.control.loop import ControlLoop, LoopConfig
from robot.devices.simulation.camera import SimCamera, SimCameraOptions
from robot.devices.simulation.driver import SimDriver, SimOptions
from robot.errors import RobotError
from robot.lab.metrics.log import DriveLog, DriveSample
from robot.lab.simulated_pilots.pilot import SimulatedPilot
from robot.lab.simulated_pilots.situation import Situation, observe
from robot.policy.policy import Policy
from robot.testing import VirtualClock
from robot.types import Action, Mode, Pose, Prediction, StartStop

FRAME_RATE_HZ = 10.0
"""Frames, ticks and heartbeats a second: about the paper's cycle rate with 32 nodes."""
PATIENT_LINK = LinkGovernorConfig(warn_s=10.0, cap_speed_s=10.0, stop_learning_s=10.0, stop_s=10.0)
"""What a busy machine does to the link is no matter of the experiment."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where a drive takes place, and its random seed."""

    world: str
    seed: int


class Trial(StartStop):
    """A simulated robot, its loop and its pilot, on a clock that runs as fast as the machine can.

    Use it as a context manager: it holds a renderer, which belongs to this thread.

    Args:
        place: Where it drives.
        policy: What learns.
        pilot: Who teaches.
        rate_hz: Frames, ticks and heartbeats a second.
        drift: How far the wheels drift apart while the pilot teaches (`Simulation.drift_share`).
    """

    def __init__(
        self,
        place: Place,
        policy: Policy,
        pilot: SimulatedPilot,
        *,
        rate_hz: float = FRAME_RATE_HZ,
        drift: float = 0.0,
    ) -> None:
        self.clock = VirtualClock()
        self.rate_hz = rate_hz
        self.drift = drift
        self.driver = SimDriver(SimOptions(world=place.world, seed=place.seed))
        self.camera = SimCamera(self.driver, SimCameraOptions(), self.clock)
        self.policy = policy
        self.pilot = pilot
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
        until: Callable[[DriveSample], bool] = lambda moment: False,
    ) -> DriveLog:
        """Drive for a while in one mode, and return what happened.

        Args:
            mode: TRAIN: the pilot drives. AUTONOMOUS: the robot does.
            seconds: How long.
            supervised: False: the pilot only watches and never takes the wheel.
            until: The drive ends early after the first moment for which this is true.

        Raises:
            RobotError: If the loop stopped by itself: an experiment must not go on then.
        """
        log = DriveLog()
        self.driver.simulation.drift_share = self.drift if mode is Mode.TRAIN else 0.0
        self.pilot.change_mode(mode if supervised else Mode.STOPPED)
        self.loop.set_mode(Mode.STOPPED)
        self._turn()
        self.loop.set_mode(mode)
        for _ in range(round(seconds * self.rate_hz)):
            log.add(self._turn())
            if self.loop.state.decision.mode is Mode.STOPPED:
                raise RobotError(f"the robot stopped at {self.clock.now_s():.1f} s: {self._why()}")
            if until(log.moments[-1]):
                break
        return log

    def timing(self) -> dict[str, float]:
        """Return how many pictures there were, and how many a second of this machine's time."""
        seconds = time.perf_counter() - self._started_s
        return {"frames": self._frames, "frames_per_s": self._frames / seconds}

    def _turn(self) -> DriveSample:
        """Advance by one frame, show it to the pilot, and tick the loop."""
        self.clock.advance(1 / self.rate_hz)
        self.driver.advance(1 / self.rate_hz)
        frame = self.camera.capture()
        self._frames += 1
        now_s = self.clock.now_s()
        situation = observe(self.driver.simulation, frame.frame_id, now_s)
        self.pilot.see(situation, _action_of(self.loop.state.prediction))
        command = self.pilot.act(now_s)
        if command is not None:
            self.loop.command(command)
        tick = self.loop.tick(now_s)
        target = situation.target
        said = tick.commands[-1] if tick.commands else None
        return DriveSample(
            now_s=now_s,
            action=tick.sent,
            driven_by=tick.decision.driven_by,
            point=tick.decision.point,
            distance_m=tick.sensors.distance_m or 0.0,
            pose=tick.sensors.pose or Pose(x_m=0.0, y_m=0.0, heading_rad=0.0),
            is_touching=self.driver.simulation.is_touching,
            is_pushing=self.driver.simulation.is_pushing,
            asks_pilot=tick.decision.asks_pilot,
            is_intervention=(
                tick.decision.mode is Mode.AUTONOMOUS and said is not None and said.held is not None
            ),
            proposed=_action_of(tick.prediction),
            wanted=said.held if said is not None else None,
            right_m=situation.range_at_m(-math.pi / 2),
            target_bearing_rad=target.bearing_rad if target else None,
            target_m=target.distance_m if target else None,
            target_gap_m=target.wall_gap_m if target else None,
        )

    def _why(self) -> str:
        state = self.loop.state
        return state.fault or str(state.decision.stop_reason)

    def start(self) -> None:
        self.driver.connect()

    def stop(self) -> None:
        self.driver.disconnect()
        self.driver.simulation.close()


def drive_by_hand(
    driver: SimDriver,
    pilot: SimulatedPilot,
    clock: VirtualClock,
    seconds: float,
    rate_hz: float,
    propose: Callable[[Situation], Action | None] = lambda situation: None,
) -> Iterator[tuple[Situation, Action | None]]:
    """Let a pilot drive without a loop; yield each situation, and what the pilot then holds.

    `propose` says what a robot would do there, which the pilot sees on the screen.
    """
    pilot.change_mode(Mode.TRAIN)
    for frame_id in range(1, round(seconds * rate_hz) + 1):
        clock.advance(1 / rate_hz)
        driver.advance(1 / rate_hz)
        situation = observe(driver.simulation, frame_id, clock.now_s())
        pilot.see(situation, propose(situation))
        command = pilot.act(situation.at_s)
        held = command.held if command is not None else None
        if command is not None and command.point is not None:
            driver.send_point(command.point)
        else:
            driver.send_action(held or Action.STOP)
        yield situation, held


def _action_of(prediction: Prediction | None) -> Action | None:
    return prediction.action if prediction is not None else None
