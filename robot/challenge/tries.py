"""A challenge: three tries of a minute, in which the robot drives by itself. Pure.

A person arms a try, which begins when the robot drives by itself. The try ends when the pilot takes
the wheel, when the robot hits something, asks for help or is stopped, or after `TRY_S`. A try that
is stopped before it scores, for example by a slow link, does not count. The best try counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from robot.challenge.score import Score
from robot.control.state import Tick
from robot.policy.events import Replaced
from robot.types import Action, DrivenBy, Mode

TRIES = 3
"""Number of tries in a challenge."""
TRY_S = 60.0
"""Length of a try, in seconds."""
_PUSHED_S = 0.3
"""Time for which the robot may drive against an obstacle before the try ends, in seconds."""
_LONGEST_STEP_S = 0.25


class Ending(StrEnum):
    """The reason why a try ended."""

    TIME = "time"
    TOUCHED = "touched"
    BUMPED = "bumped"
    ASKED = "asked"
    STOPPED = "stopped"


@dataclass(frozen=True, slots=True)
class Try:
    """One try that has ended."""

    metres: float
    seconds: float
    ended_by: Ending


class Challenge:
    """Follows one robot. Call all methods on the loop's thread."""

    def __init__(self) -> None:
        self.best_m: float | None = None
        self.tries: tuple[Try, ...] = ()
        self.is_armed = False
        self.is_shown = False
        """True while the best try is shown on the class's board."""
        self._score: Score | None = None
        self._seconds = self._pushed_s = 0.0
        self._last_s: float | None = None

    @property
    def is_on(self) -> bool:
        """True while a try is in progress."""
        return self._score is not None

    @property
    def metres(self) -> float:
        """The score of the current try, in metres."""
        return self._score.metres if self._score is not None else 0.0

    @property
    def left_s(self) -> float:
        """The remaining time of the current try, in seconds."""
        return max(0.0, TRY_S - self._seconds)

    def arm(self) -> None:
        """Make the next drive count as a try. If the last try of a challenge has ended, begin a new
        challenge."""
        if self.is_on:
            return
        if len(self.tries) >= TRIES:
            self.tries = ()
        self.is_armed = True

    def cancel(self) -> None:
        """Cancel the armed or current try; it does not count."""
        self.is_armed, self._score = False, None

    def note(self, tick: Tick) -> Try | None:
        """Process one tick of the loop; return the try that this tick ended, or None."""
        step_s = 0.0 if self._last_s is None else tick.now_s - self._last_s
        step_s = min(max(step_s, 0.0), _LONGEST_STEP_S)
        self._last_s = tick.now_s
        if any(isinstance(event, Replaced) for event in tick.history_events):
            self.cancel()  # the model was replaced during the try, so the try does not count
            self.tries, self.best_m, self.is_shown = (), None, False
        is_alone = tick.decision.driven_by is DrivenBy.ROBOT
        if self.is_armed and is_alone and tick.sensors.pose is not None:
            self.is_armed, self._score = False, Score()
            self._seconds = self._pushed_s = 0.0
        if self._score is None:
            return None
        is_against = tick.prediction is not None and tick.prediction.is_stalled
        is_against = tick.sent is not Action.STOP and (is_against or bool(tick.sensors.bumped))
        self._pushed_s = self._pushed_s + step_s if is_against else 0.0
        self._seconds += step_s
        if is_alone and tick.sensors.pose is not None:
            self._score.note(tick.sensors.pose)
        ending = self._ending(tick)
        return self._end(ending) if ending is not None else None

    def _ending(self, tick: Tick) -> Ending | None:
        decision = tick.decision
        if decision.driven_by is DrivenBy.PILOT:
            return Ending.TOUCHED
        if self._pushed_s >= _PUSHED_S:
            return Ending.BUMPED
        if decision.mode is not Mode.AUTONOMOUS:
            return Ending.STOPPED
        if decision.asks_pilot:
            return Ending.ASKED
        return Ending.TIME if self._seconds >= TRY_S else None

    def _end(self, ending: Ending) -> Try | None:
        if ending is Ending.STOPPED and self.metres == 0.0:
            self.is_armed, self._score = True, None
            return None
        done = Try(round(self.metres, 2), round(self._seconds, 1), ending)
        self.tries, self._score = (*self.tries, done), None
        self.best_m = max(self.best_m or 0.0, done.metres)
        return done
