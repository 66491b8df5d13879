"""Decides who drives: nobody, the pilot or the robot. Pure; time is an argument.

The rules, in order of priority:

1. A latched emergency stop, or mode STOPPED: nobody drives.
2. Anything in doubt (pilot gone or silent, picture stale, camera or drive faulty) *trips* the
   gate: the mode falls to STOPPED, the reason is stored, and the gate waits for an explicit start.
   The mode never falls through to AUTONOMOUS.
3. The pilot's move has priority over the robot's, in TRAIN and in AUTONOMOUS.
4. In AUTONOMOUS the robot drives while the pilot holds no move; when the pilot lets go, the robot
   drives again.
"""

from __future__ import annotations

import logging
import math
from collections import Counter
from collections.abc import Callable
from dataclasses import replace

from robot.control.config import GateConfig
from robot.types import Action, Decision, DrivenBy, Mode, PilotCommand, Prediction, StopReason

log = logging.getLogger(__name__)


class Gate:
    """The dead man's switch, and the choice of the driver.

    `on_stop` is called whenever a robot that could move is stopped.

    Attributes:
        mode: The pilot's request; STOPPED after any stop.
        stop_reason: The reason for the last stop; None once the robot has been started again.
        emergency: True while an emergency stop is latched and no mode can be chosen.
        stops: Number of stops of a robot that could move, by reason.
    """

    def __init__(
        self, config: GateConfig | None = None, on_stop: Callable[[], None] = lambda: None
    ) -> None:
        self.config = config or GateConfig()
        self._on_stop = on_stop
        self.mode = Mode.STOPPED
        self.stop_reason: StopReason | None = None
        self.emergency = False
        self.stops: Counter[StopReason] = Counter()
        self._command: PilotCommand | None = None
        self._heard_s = self._proven_s = self._awaits_picture_until_s = -math.inf
        self._has_refused = False  # since the start

    @property
    def held(self) -> Action | None:
        """The move that the pilot holds now."""
        return self._command.held if self._command else None

    @property
    def silent_at_s(self) -> float:
        """Time at which the pilot will count as silent; infinite when stopped.

        While the robot drives by itself, the pilot may be silent for longer.
        """
        if self.mode is Mode.STOPPED:
            return math.inf
        supervised_s = self._proven_s + self.config.supervision_timeout_s
        if self.mode is Mode.AUTONOMOUS and self.held is None:
            return supervised_s
        return min(supervised_s, self._heard_s + self.config.pilot_timeout_s)

    def is_fresh(self, proven_s: float, now_s: float) -> bool:
        """True if a message sent at `proven_s` or later is new enough to move the robot."""
        return now_s - proven_s <= self.config.command_timeout_s

    def start(self, mode: Mode, now_s: float, proven_s: float | None = None) -> bool:
        """Enter `mode` on the pilot's explicit request. Return False while an emergency is latched
        or if the request is too old; STOPPED is always accepted.

        A move that the pilot held before does not count in the new mode. The robot first stands
        still until a fresh picture comes, for at most `start_patience_s`. `proven_s` is the
        earliest time at which the request can have been sent; None means now.
        """
        if mode is Mode.STOPPED:
            self.trip(StopReason.PILOT_ASKED)
            return True
        if self.emergency:
            return False
        proven_s = now_s if proven_s is None else min(proven_s, now_s)
        if not self.is_fresh(proven_s, now_s):
            self.trip(StopReason.LINK_SLOW)
            self.stop_reason = StopReason.LINK_SLOW
            return False
        self.mode, self.stop_reason, self._command = mode, None, None
        self._heard_s, self._proven_s = now_s, proven_s
        self._has_refused = False
        self._awaits_picture_until_s = now_s + self.config.start_patience_s
        return True

    def receive(self, command: PilotCommand, now_s: float) -> bool:
        """Accept or refuse the pilot's newest command; return True if it is accepted.

        A command is refused if it is too old, or if it names no frame, because a pilot who sees no
        picture can neither drive nor supervise. A refused command does not end the pilot's silence.
        """
        proven_s = command.received_s if command.proven_s is None else command.proven_s
        if command.frame_id is None or not self.is_fresh(min(proven_s, now_s), now_s):
            self._has_refused = True
            return False
        self._command = command
        self._heard_s = command.received_s
        self._proven_s = max(self._proven_s, min(proven_s, now_s))
        self._has_refused = False
        return True

    def trip(self, reason: StopReason) -> None:
        """Stop for `reason`, and wait for an explicit start. A robot that is already stopped keeps
        the earlier reason."""
        self._command = None
        if self.mode is not Mode.STOPPED:
            self.mode, self.stop_reason = Mode.STOPPED, reason
            self.stops[reason] += 1
            log.info("stop reason=%s", reason.value)
            self._on_stop()

    def latch_emergency(self) -> None:
        """Stop until `release_emergency` is called; before that no mode can be chosen."""
        self.trip(StopReason.EMERGENCY)
        self.stop_reason = StopReason.EMERGENCY
        self.emergency = True

    def release_emergency(self) -> None:
        """Allow modes to be chosen again. The robot stays stopped until a mode is chosen."""
        self.emergency = False

    def select(
        self,
        now_s: float,
        prediction: Prediction | None,
        frame_age_s: float,
        frame_timeout_s: float,
        *,
        camera_fault: bool,
    ) -> Decision:
        """Decide this tick's action. If anything is in doubt, call `trip` first.

        `prediction` and `frame_age_s` belong to the newest frame. Before the first frame,
        `prediction` is None and `frame_age_s` is infinite. `frame_timeout_s` is the frame's maximum
        age.
        """
        if self.mode is not Mode.STOPPED:
            is_fresh = frame_age_s <= frame_timeout_s
            if is_fresh:
                self._awaits_picture_until_s = -math.inf
            is_waiting = now_s <= self._awaits_picture_until_s
            doubt = self._doubt(now_s, camera_fault, is_fresh or is_waiting)
            if doubt is not None:
                self.trip(doubt)
            elif is_waiting:
                return self.stand()
        if self.mode is Mode.STOPPED:
            return self.stand()
        if self.held is not None:
            point = self._command.point if self._command else None
            return Decision(action=self.held, driven_by=DrivenBy.PILOT, mode=self.mode, point=point)
        if self.mode is Mode.TRAIN:
            return self.stand()
        return self._robot_drives(prediction)

    def _doubt(self, now_s: float, camera_fault: bool, may_use_picture: bool) -> StopReason | None:
        if now_s > self.silent_at_s:
            return StopReason.LINK_SLOW if self._has_refused else StopReason.PILOT_SILENT
        if camera_fault:
            return StopReason.CAMERA_FAULT
        return None if may_use_picture else StopReason.FRAME_STALE

    def _robot_drives(self, prediction: Prediction | None) -> Decision:
        if prediction is None or prediction.action is None:
            return self.stand(DrivenBy.ROBOT, asks_pilot=True)
        # A robot that asks for help does not enter STOPPED; it drives on once the pilot steers.
        if prediction.needs_help:
            asks = self.stand(DrivenBy.ROBOT, asks_pilot=True)
            return replace(asks, stop_reason=StopReason.NEEDS_HELP)
        # Turns are never slowed down, because a turn leads the robot out of an unknown view.
        is_slow = prediction.is_novel and not prediction.is_turn
        scale = self.config.novel_speed_scale if is_slow else 1.0
        return Decision(
            action=prediction.action,
            driven_by=DrivenBy.ROBOT,
            mode=self.mode,
            speed_scale=scale,
            asks_pilot=prediction.is_novel,
            point=prediction.point,
        )

    def stand(self, driven_by: DrivenBy = DrivenBy.NOBODY, *, asks_pilot: bool = False) -> Decision:
        """Return a decision that keeps the robot still, with the current mode and stop reason."""
        return Decision(
            action=Action.STOP,
            driven_by=driven_by,
            mode=self.mode,
            stop_reason=self.stop_reason,
            asks_pilot=asks_pilot,
        )
