"""Human delays and errors: reaction time, tremor and lapses.

The hand carries out each decision `reaction_s` after the pilot made it. A command contains the id
of the frame that was on the screen when the command was sent.
"""

from __future__ import annotations

import math
import random
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from robot.types import Action, PilotCommand, Point

EPSILON_S = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class HumanDelayConfig:
    """A person's speed and precision. The default is a practised person on a fast link."""

    reaction_s: float = 0.2
    tremors_per_min: float = 4.0
    """Number of slips of the finger to another button, per minute."""
    tremor_s: float = 0.15
    lapses_per_min: float = 1.0
    """Number of times per minute that the pilot looks away and keeps holding the same button."""
    lapse_s: float = 0.8
    looks_hz: float = 10.0
    """Number of times per second that the pilot looks at the screen. For people it is 5 to 10."""
    pauses_per_min: float = 0.0
    """Number of times per minute that the pilot releases the button to think."""
    pause_s: float = 1.0


PRACTISED = HumanDelayConfig()
STEADY = HumanDelayConfig(
    reaction_s=0.0, tremors_per_min=0.0, lapses_per_min=0.0, looks_hz=math.inf
)
"""No human delays, as if the teacher were a program on the robot itself."""


class HumanDelayModel:
    """Converts decisions to commands, with human delays and errors. The pilot's finger may slip to
    any of `buttons`."""

    def __init__(self, config: HumanDelayConfig, buttons: Sequence[Action], seed: str) -> None:
        self.config = config
        self._buttons = list(buttons)
        self._chance = random.Random(f"{seed} hand")
        self._wishes: deque[tuple[float, Action | None, Point | None]] = deque()
        self._held: Action | None = None
        self._point: Point | None = None
        self._slips_until_s = self._away_until_s = self._pauses_until_s = -1.0
        self._slip: Action | None = None
        self._last_s: float | None = None
        self._seq = 0

    def wish(self, action: Action | None, now_s: float, point: Point | None = None) -> None:
        """Decide to hold `action`, or to let go if it is None; the hand follows later."""
        self._wishes.append((now_s + self.config.reaction_s, action, point))

    def send(self, frame_id: int | None, frame_age_s: float, now_s: float) -> PilotCommand:
        """Return the pilot's next command: the move whose button is pressed, and the number of the
        frame on the screen. Call this at every heartbeat."""
        self._seq += 1
        return PilotCommand(
            held=(held := self._hold(now_s)),
            # a hand that slips presses a button, which has no steering and throttle
            point=self._point if held is self._held else None,
            frame_id=frame_id,
            seq=self._seq,
            received_s=now_s,
            pilot="simulated",
            frame_age_s=frame_age_s,
        )

    def release(self) -> None:
        """Release the button immediately, and drop the decision that the hand has not carried out
        yet."""
        self._wishes.clear()
        self._held = self._point = None

    def _hold(self, now_s: float) -> Action | None:
        dt_s = now_s - self._last_s if self._last_s is not None else 0.0
        self._last_s = now_s
        self._begin_by_chance(now_s, dt_s)
        if now_s >= self._away_until_s:
            while self._wishes and self._wishes[0][0] <= now_s + EPSILON_S:
                _, self._held, self._point = self._wishes.popleft()
        if now_s < self._pauses_until_s:
            return None
        slips = self._held is not None and now_s < self._slips_until_s
        return self._slip if slips else self._held

    def _begin_by_chance(self, now_s: float, dt_s: float) -> None:
        """Begin a tremor, a lapse or a pause at random. Each call draws equally many random
        numbers, so that later draws do not depend on whether something begins."""
        config = self.config
        tremor, lapse = self._chance.random(), self._chance.random()
        other = self._chance.choice(self._buttons)
        if tremor < config.tremors_per_min / 60 * dt_s:
            self._slips_until_s, self._slip = now_s + config.tremor_s, other
        if lapse < config.lapses_per_min / 60 * dt_s:
            self._away_until_s = now_s + config.lapse_s
        if config.pauses_per_min and self._chance.random() < config.pauses_per_min / 60 * dt_s:
            self._pauses_until_s = now_s + config.pause_s
