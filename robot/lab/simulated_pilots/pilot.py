"""A whole simulated pilot: a screen, a teacher's judgement, and human delays."""

from __future__ import annotations

import random
from dataclasses import dataclass

from robot.lab.simulated_pilots.hand import EPSILON_S, PRACTISED, HumanDelayConfig, HumanDelayModel
from robot.lab.simulated_pilots.situation import Situation
from robot.lab.simulated_pilots.teachers import Teacher
from robot.types import Action, Mode, PilotCommand


@dataclass(frozen=True, slots=True, kw_only=True)
class TakeoverPolicy:
    """Rules for when a pilot takes control from the robot, and gives it back."""

    patience_s: float = 0.5
    """The pilot takes control if the teacher has tolerated none of the robot's moves for this time,
    in seconds."""
    shortest_hold_s: float = 0.8
    contented_s: float = 0.5
    """The pilot gives control back if the robot has proposed the pilot's own moves for this time,
    in seconds."""
    longest_hold_s: float = 8.0
    lenience: float = 0.5
    """Share of incidents in which the pilot first lets the robot get stuck and then shows the way
    out. Without such examples the robot would never learn what to do near a wall."""
    lenient_patience_s: float = 2.0


LENIENT = TakeoverPolicy()


class SimulatedPilot:
    """Acts like a pilot with a phone: sees frames, holds buttons, and sends commands."""

    def __init__(
        self,
        teacher: Teacher,
        moves: tuple[Action, ...],
        *,
        hand: HumanDelayConfig = PRACTISED,
        takeover: TakeoverPolicy = LENIENT,
        seed: str = "0",
    ) -> None:
        self.teacher = teacher
        self.takeover = takeover
        self.mode = Mode.STOPPED
        self._hand = HumanDelayModel(hand, moves, seed)
        self._chance = random.Random(f"{seed} manners")
        self._screen: tuple[Situation, Action | None] | None = None
        self._looks_at_s: float | None = None
        self._holds_since_s: float | None = None
        self._annoyed_since_s: float | None = None
        self._content_since_s: float | None = None
        self._patience_s = self.takeover.patience_s

    def change_mode(self, mode: Mode) -> None:
        """Begin another phase of the trial. The pilot releases the button."""
        self.mode = mode
        self._hand.release()
        self._holds_since_s = self._annoyed_since_s = self._content_since_s = None

    def act(self, situation: Situation, proposed: Action | None) -> PilotCommand:
        """Look at a new frame and at the robot's proposal for it. Return the command that the pilot
        then sends."""
        self._look_until(situation.at_s - EPSILON_S)
        self._screen = (situation, proposed)
        if self._looks_at_s is None:
            self._looks_at_s = situation.at_s
        self._look_until(situation.at_s + EPSILON_S)
        return self._hand.send(situation.frame_id, 0.0, situation.at_s)

    def _look_until(self, end_s: float) -> None:
        """Look at the picture on the screen whenever a look is due.

        The times do not depend on the pictures. If a pilot who looks every 0.125 s waited for the
        next picture, and a picture came every 0.1 s, the pilot would look only every 0.2 s. The
        pilot would then drive differently at ten and at thirty pictures a second.
        """
        period_s = 1 / self._hand.config.looks_hz
        while self._screen and self._looks_at_s is not None and self._looks_at_s <= end_s:
            at_s = self._looks_at_s
            held = self._judge(*self._screen, at_s)
            point = getattr(self.teacher, "point", None) if held is not None else None
            self._hand.wish(held, at_s, point)
            # None means that the pilot looks at the next picture.
            self._looks_at_s = at_s + period_s if period_s else None

    def _judge(self, situation: Situation, proposed: Action | None, now_s: float) -> Action | None:
        """Return the move that the pilot holds; None if the pilot holds no button."""
        if self.mode is Mode.STOPPED:
            return None
        wanted = self.teacher.choose(situation)
        if self.mode is Mode.TRAIN:
            return wanted
        if self._holds_since_s is None:
            self._consider_taking(situation, now_s)
        else:
            self._consider_giving_back(wanted, proposed, now_s)
        return wanted if self._holds_since_s is not None else None

    def _consider_taking(self, situation: Situation, now_s: float) -> None:
        if self.teacher.tolerates(situation, situation.doing):
            self._annoyed_since_s = None
            return
        if self._annoyed_since_s is None:
            self._annoyed_since_s = now_s
            is_lenient = self._chance.random() < self.takeover.lenience
            self._patience_s = (
                self.takeover.lenient_patience_s if is_lenient else self.takeover.patience_s
            )
        if now_s - self._annoyed_since_s >= self._patience_s - EPSILON_S:
            self._holds_since_s, self._content_since_s = now_s, None

    def _consider_giving_back(self, wanted: Action, proposed: Action | None, now_s: float) -> None:
        assert self._holds_since_s is not None
        if proposed is not wanted:
            self._content_since_s = None
        elif self._content_since_s is None:
            self._content_since_s = now_s
        held_s = now_s - self._holds_since_s
        content_s = now_s - self._content_since_s if self._content_since_s is not None else 0.0
        takeover = self.takeover
        if held_s >= takeover.longest_hold_s or (
            held_s >= takeover.shortest_hold_s and content_s >= takeover.contented_s - EPSILON_S
        ):
            self._holds_since_s = self._annoyed_since_s = None
