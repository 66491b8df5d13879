"""Reacts to a slow link or computer: warns, slows down, stops learning, or stops the robot. Pure.

The link is judged by the age of the picture that the pilot reacts to. The level rises immediately,
and falls only after the link has been clearly better for a while (hysteresis).
"""

from __future__ import annotations

import math

from robot.control.config import LinkGovernorConfig
from robot.control.state import CameraState, LinkLevel, LinkState
from robot.types import PilotCommand

_LEVELS = tuple(LinkLevel)
_FADES = 0.9
"""Factor by which the computer's recorded lateness decays until the next measurement."""


def age_of_link_s(
    picture_age_s: float, reported_age_s: float | None, phone_s: float | None = None
) -> float:
    """Return the link's delay: that of the picture or that of the command, whichever is larger.

    `picture_age_s` is the time from the picture's arrival at the loop until the command's arrival.
    `reported_age_s` is the page's estimate of the picture's age when the command was sent; if it is
    None, the whole age is attributed to the link. `phone_s` is the time on the phone, if known. It
    is subtracted, so that a slow phone does not stop learning.
    """
    if reported_age_s is None:
        return picture_age_s
    on_screen_s = min(max(reported_age_s, 0.0), picture_age_s)
    down_s = max(0.0, on_screen_s - max(phone_s or 0.0, 0.0))
    return max(down_s, picture_age_s - on_screen_s)


class LinkGovernor:
    """Turns ages into a level, with hysteresis."""

    def __init__(self, config: LinkGovernorConfig | None = None) -> None:
        self.config = config or LinkGovernorConfig()
        c = self.config
        self._lateness_s = 0.0
        self._thresholds_s = (c.warn_s, c.cap_speed_s, c.stop_learning_s, c.stop_s)
        self.forget()

    def forget(self) -> None:
        """Reset, because another pilot has another link."""
        self.level = LinkLevel.GOOD
        self.age_s: float | None = None
        self._better_since_s: float | None = None
        self._seen_s = math.inf

    def judge(
        self,
        command: PilotCommand,
        named_s: tuple[float, float],
        seen_s: float,
        camera: CameraState,
        now_s: float,
    ) -> None:
        """Measure the link's delay from a command, even if the command is too old to be obeyed.

        `named_s` holds two times of the frame that the command names: its capture, and its delivery
        to the loop. `seen_s` is the delivery time of the newest frame that the page acknowledged.
        """
        captured_s, delivered_s = named_s
        self.note_seen(seen_s)
        reported_s = command.frame_age_s
        if reported_s is not None:
            reported_s -= delivered_s - captured_s
        # The slack covers a picture's time on the phone, and is needed only if that is unknown.
        slack_s = camera.slack_s if command.phone_s is None else 0.0
        age_s = age_of_link_s(command.received_s - delivered_s, reported_s, command.phone_s)
        self.note_age(age_s, now_s, slack_s)

    def note_seen(self, delivered_s: float) -> None:
        """Record that the pilot saw a picture that reached the loop at `delivered_s`."""
        self._seen_s = delivered_s

    def blind_in_s(self, now_s: float, slack_s: float = 0.0) -> float:
        """Return the time until the pilot has seen no new picture for `stop_s`, and counts as
        blind. The time is negative for a blind pilot, and infinite before the first picture."""
        return self.config.stop_s + slack_s - (now_s - self._seen_s)

    def note_age(self, age_s: float, now_s: float, slack_s: float = 0.0) -> None:
        """Record an age. The level rises immediately, but falls only after `recovery_s` with lower
        ages. `slack_s` is the part of the age that is due to the camera's period.
        """
        self.age_s = age_s
        age_s -= slack_s
        present = _LEVELS.index(self.level)
        self.level = _LEVELS[max(present, self._rank(age_s, 1.0))]
        if self._rank(age_s, self.config.recovery_share) >= present:
            self._better_since_s = None
        elif self._better_since_s is None:
            self._better_since_s = now_s
        elif now_s - self._better_since_s >= self.config.recovery_s:
            self.level = _LEVELS[present - 1]
            self._better_since_s = now_s

    def note_lateness(self, late_s: float, *, is_to_blame: bool) -> None:
        """Record the computer's lateness; called ten times a second. The recorded value decays
        within two seconds, unless the lateness has stopped the robot."""
        self._lateness_s = max(late_s, self._lateness_s * (1.0 if is_to_blame else _FADES))

    def state(self, now_s: float, slack_s: float = 0.0) -> LinkState:
        """Return the limits; see `blind_in_s` for the arguments. A blind pilot must not drive."""
        level, is_busy = self.level, self._lateness_s > self.config.busy_s
        is_free = level in (LinkLevel.GOOD, LinkLevel.SLOW) and not is_busy
        return LinkState(
            level=level,
            age_s=self.age_s,
            is_busy=is_busy,
            must_stop=level is LinkLevel.TOO_SLOW or self.blind_in_s(now_s, slack_s) < 0,
            may_learn=level not in (LinkLevel.NOT_LEARNING, LinkLevel.TOO_SLOW),
            speed_scale=1.0 if is_free else self.config.capped_speed_scale,
        )

    def _rank(self, age_s: float, share: float) -> int:
        return sum(age_s > threshold_s * share for threshold_s in self._thresholds_s)
