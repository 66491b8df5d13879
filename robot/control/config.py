"""The time limits of the control loop, which the settings can change."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True, kw_only=True)
class GateConfig:
    """Time limits of the gate, in seconds."""

    pilot_timeout_s: float = 0.3
    """Longest silence of a pilot in mode TRAIN, or of a pilot who holds a move in any mode."""
    supervision_timeout_s: float = 0.45
    """Longest time without a command from the pilot, in every mode. The time is counted from the
    earliest moment at which the last command can have been sent, so it includes the network delay.
    Even if the robot stops one tick late, it stands still within 0.5 s."""
    command_timeout_s: float = 0.3
    """Maximum age of a command that is still obeyed, counted like `supervision_timeout_s`."""
    frame_timeout_s: float = 0.2
    """Maximum age of the newest picture while the robot may move. The limit is higher for a slower
    camera: see `robot.control.camera_timing`."""
    start_patience_s: float = 0.5
    """Maximum time for which a robot that was started waits for its first fresh picture."""
    novel_speed_scale: float = 0.5
    """Share of full speed while the robot drives straight and does not recognise the view."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkGovernorConfig:
    """Thresholds of the link governor for the age of the pilot's picture, in seconds."""

    warn_s: float = 0.2
    cap_speed_s: float = 0.25
    stop_learning_s: float = 0.3
    stop_s: float = 0.5
    busy_s: float = 0.1
    """Lateness of this computer above which the robot drives slower, but does not stop yet."""
    capped_speed_scale: float = 0.5
    """Share of full speed while the age exceeds `cap_speed_s` or the lateness exceeds `busy_s`."""
    recovery_share: float = 0.85
    """The link's level falls only if the age is below this share of the level's threshold."""
    recovery_s: float = 1.0
    """Time for which the age must stay below `recovery_share` before the level falls."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraTimingConfig:
    """Configures how the limits on the newest picture's age adapt to the camera."""

    longest_timeout_s: float = 0.5
    """Age of the newest picture above which the robot stops. At 0.16 m/s it travels 8 cm in this
    time. If the camera's period exceeds `full_speed_s`, the excess is added to this limit. The
    robot then drives slower, so the distance stays within 8 cm."""
    full_speed_s: float = 0.3
    """Maximum age of the newest picture at full speed. At 0.16 m/s the robot travels 5 cm in this
    time. With older pictures the robot drives slower, so the distance stays within 5 cm."""
    growth_s_per_s: float = 0.05
    """Largest growth of an estimate while the robot may move; unlimited while it stands still."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopConfig:
    """All time limits of a control loop, in seconds."""

    gate: GateConfig = field(default_factory=GateConfig)
    governor: LinkGovernorConfig = field(default_factory=LinkGovernorConfig)
    camera: CameraTimingConfig = field(default_factory=CameraTimingConfig)
    longest_wait_s: float = 0.05
    """Longest time between two ticks, even if the camera sends no pictures."""
    stall_s: float = 0.3
    """After a longer gap between two ticks the robot stops, because earlier commands are stale."""
