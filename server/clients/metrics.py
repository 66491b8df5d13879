"""The measurements for `/metrics`, in Prometheus' text format. Pure."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import accumulate
from typing import Any

from robot.control.state import LoopState
from robot.types import Mode, StopReason
from server.protocol import ErrorCode

Values = Mapping[str, float] | float

AGE_BUCKETS_S = (0.025, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.5, 1.0, 2.0)


class Histogram:
    """A histogram with fixed upper bounds."""

    def __init__(self, buckets: tuple[float, ...]) -> None:
        self.buckets = buckets
        self.counts = [0] * (len(buckets) + 1)
        self.total = 0.0

    def note(self, value: float) -> None:
        """Count one value."""
        self.counts[bisect_left(self.buckets, value)] += 1
        self.total += value


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """All measurements, gathered in one place."""

    state: LoopState
    now_s: float
    clients: int
    viewers: int
    frames_sent: int
    frames_encoded: int
    frame_ages: Histogram
    refused: Mapping[ErrorCode, int] = field(default_factory=dict)
    turned_away: Mapping[str, int] = field(default_factory=dict)


CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"


def render(measured: Measured) -> bytes:
    """Return the whole text. Imports prometheus-client only when asked for."""
    from prometheus_client import CollectorRegistry, generate_latest

    registry = CollectorRegistry(auto_describe=False)
    registry.register(_Collector(measured))
    return bytes(generate_latest(registry))


class _Collector:
    """Hands one set of measurements to prometheus-client."""

    def __init__(self, measured: Measured) -> None:
        self._measured = measured

    def collect(self) -> Iterator[Any]:
        """Yield the families of metrics."""
        m, state = self._measured, self._measured.state
        yield _gauge("loop_rate_hz", "New frames a second", state.cycle_hz)
        yield _counter("loop_turns_total", "Ticks of the control loop", state.cycles)
        yield _counter("loop_late_cycles_total", "Ticks that took too long", state.late_cycles)
        yield _gauge("loop_age_seconds", "Since the last tick", m.now_s - state.now_s)
        modes = {mode.value: int(state.decision.mode is mode) for mode in Mode}
        yield _gauge("mode", "1 for the present mode", modes, "mode")
        yield _gauge("emergency", "1 while latched", int(state.emergency))
        stops = {reason.value: state.stops.get(reason, 0) for reason in StopReason}
        yield _counter("stops_total", "Stops by reason", stops, "reason")
        yield _gauge("pages", "Open control sockets", m.clients)
        yield _gauge("viewers", "Browsers that see the picture", m.viewers)
        yield _counter("frames_sent_total", "Frames to viewers", m.frames_sent)
        yield _counter("frames_encoded_total", "Frames made ready to send", m.frames_encoded)
        yield _ages(m.frame_ages)
        if state.pilot_frame_age_s is not None:
            yield _gauge(
                "pilot_frame_age_seconds",
                "Age of the picture that the pilot acts upon",
                state.pilot_frame_age_s,
            )
        refused = {code.value: m.refused.get(code, 0) for code in ErrorCode}
        yield _counter("messages_refused_total", "Websocket messages refused", refused, "code")
        turned_away = dict(sorted(m.turned_away.items()))
        yield _counter(
            "requests_refused_total", "Requests and websockets refused", turned_away, "reason"
        )
        yield _learner_times(state)


def _gauge(name: str, text: str, value: Values, label: str | None = None) -> Any:
    from prometheus_client.core import GaugeMetricFamily

    return _filled(GaugeMetricFamily, name, text, value, label)


def _counter(name: str, text: str, value: Values, label: str | None = None) -> Any:
    from prometheus_client.core import CounterMetricFamily

    return _filled(CounterMetricFamily, name, text, value, label)


def _filled(kind: Any, name: str, text: str, value: Values, label: str | None) -> Any:
    family = kind(f"drivelesson_{name}", text, labels=[label] if label else [])
    if isinstance(value, Mapping):
        for key, number in value.items():
            family.add_metric([key], number)
    else:
        family.add_metric([], value)
    return family


def _ages(ages: Histogram) -> Any:
    from prometheus_client.core import HistogramMetricFamily

    bounds = [*map(str, ages.buckets), "+Inf"]
    return HistogramMetricFamily(
        "drivelesson_frame_age_seconds",
        "Capture to acknowledged by a viewer",
        buckets=list(zip(bounds, accumulate(ages.counts), strict=True)),
        sum_value=ages.total,
    )


def _learner_times(state: LoopState) -> Any:
    from prometheus_client.core import SummaryMetricFamily

    family = SummaryMetricFamily(
        "drivelesson_learner_seconds", "What the learner's work took", labels=["work"]
    )
    for work, timing in state.learner_times.items():
        family.add_metric([work], timing.count, timing.total_s)
    return family
