"""`/metrics` in Prometheus' text form, written by hand: it is a dozen lines. Pure."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from robot.control.state import LoopState
from robot.types import Mode, StopReason
from server.protocol import ErrorCode

AGE_BUCKETS_S = (0.025, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.5, 1.0, 2.0)


class Histogram:
    """Counts of what was at most so much."""

    def __init__(self, buckets: tuple[float, ...]) -> None:
        self.buckets = buckets
        self.counts = [0] * (len(buckets) + 1)
        self.total = 0.0

    def note(self, value: float) -> None:
        """Count one value."""
        self.counts[bisect_left(self.buckets, value)] += 1
        self.total += value

    def lines(self, name: str) -> Iterator[str]:
        """Yield it as Prometheus wants it: cumulative."""
        below = 0
        for bucket, count in zip([*map(str, self.buckets), "+Inf"], self.counts, strict=True):
            below += count
            yield f'{name}_bucket{{le="{bucket}"}} {below}'
        yield f"{name}_sum {self.total:.6f}"
        yield f"{name}_count {below}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """All that is told, gathered in one place."""

    state: LoopState
    now_s: float
    pages: int
    viewers: int
    frames_sent: int
    frames_encoded: int
    frame_ages: Histogram
    refused: Mapping[ErrorCode, int] = field(default_factory=dict)
    turned_away: Mapping[str, int] = field(default_factory=dict)


def render(measured: Measured) -> str:
    """Return the whole text."""
    return "\n".join(_lines(measured)) + "\n"


def _lines(m: Measured) -> Iterator[str]:
    state = m.state
    yield from _family("loop_rate_hz", "gauge", "New frames a second", {"": state.cycle_hz})
    yield from _family("loop_turns_total", "counter", "Turns of the loop", {"": state.cycles})
    yield from _family(
        "loop_late_cycles_total", "counter", "Turns that took too long", {"": state.late_cycles}
    )
    yield from _family(
        "loop_age_seconds", "gauge", "Since the last turn", {"": m.now_s - state.now_s}
    )
    yield from _family(
        "mode",
        "gauge",
        "1 for the present mode",
        {_label("mode", mode): int(state.decision.mode is mode) for mode in Mode},
    )
    yield from _family("emergency", "gauge", "1 while latched", {"": int(state.emergency)})
    yield from _family(
        "stops_total",
        "counter",
        "Stops by reason",
        {_label("reason", reason): state.stops.get(reason, 0) for reason in StopReason},
    )
    yield from _family("pages", "gauge", "Open control sockets", {"": m.pages})
    yield from _family("viewers", "gauge", "Browsers that see the picture", {"": m.viewers})
    yield from _family("frames_sent_total", "counter", "Frames to viewers", {"": m.frames_sent})
    yield from _family(
        "frames_encoded_total", "counter", "Frames made ready to send", {"": m.frames_encoded}
    )
    yield "# HELP drivelesson_frame_age_seconds Capture to acknowledged by a viewer"
    yield "# TYPE drivelesson_frame_age_seconds histogram"
    yield from m.frame_ages.lines("drivelesson_frame_age_seconds")
    if state.pilot_frame_age_s is not None:
        yield from _family(
            "pilot_frame_age_seconds",
            "gauge",
            "Age of the picture that the pilot acts upon",
            {"": state.pilot_frame_age_s},
        )
    yield from _family(
        "messages_refused_total",
        "counter",
        "Websocket messages refused",
        {_label("code", code): m.refused.get(code, 0) for code in ErrorCode},
    )
    yield from _family(
        "requests_refused_total",
        "counter",
        "Requests and websockets turned away",
        {_label("reason", reason): count for reason, count in sorted(m.turned_away.items())},
    )
    yield from _learner_times(state)


def _learner_times(state: LoopState) -> Iterator[str]:
    name = "drivelesson_learner_seconds"
    yield f"# HELP {name} What the learner's work took"
    yield f"# TYPE {name} summary"
    for work, timing in state.learner_times.items():
        yield f'{name}_sum{{work="{work}"}} {timing.total_s:.6f}'
        yield f'{name}_count{{work="{work}"}} {timing.count}'


def _family(name: str, kind: str, text: str, values: Mapping[str, float]) -> Iterator[str]:
    yield f"# HELP drivelesson_{name} {text}"
    yield f"# TYPE drivelesson_{name} {kind}"
    for label, value in values.items():
        yield f"drivelesson_{name}{label} {value:.6g}"


def _label(name: str, value: str) -> str:
    return f'{{{name}="{value}"}}'
