"""`/metrics`: measurements for Prometheus. See docs/reference/http.md."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import accumulate
from types import SimpleNamespace
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import PlainTextResponse, Response

from robot.types import Mode, StopReason
from server.integrations.extension import FrameAges, IntegrationsExtension
from server.protocol import ErrorCode
from server.routes.answers import Route
from server.services import Services, services_of

router = APIRouter(route_class=Route)
_CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"


@router.get("/metrics", response_class=PlainTextResponse)
async def metrics(request: Request) -> Response:
    """Return the measurements for Prometheus."""
    services = services_of(request)
    ages = services.extension(IntegrationsExtension).frame_ages
    return Response(render_metrics(services, ages), media_type=_CONTENT_TYPE)


def render_metrics(services: Services, ages: FrameAges) -> bytes:
    """Return the measurements as text. Imports prometheus-client only at the first call."""
    from prometheus_client import generate_latest

    registry: Any = SimpleNamespace(collect=lambda: _measure(services, ages))
    return bytes(generate_latest(registry))


def _measure(services: Services, ages: FrameAges) -> Iterator[Any]:
    from prometheus_client.core import CounterMetricFamily as Counter
    from prometheus_client.core import GaugeMetricFamily as Gauge
    from prometheus_client.core import HistogramMetricFamily as Histogram
    from prometheus_client.core import SummaryMetricFamily as Summary

    broadcast, state = services.hub.broadcast, services.robot.loop.state
    video, age_s = broadcast.video, services.robot.clock.now_s() - state.now_s
    modes = {mode.value: int(state.decision.mode is mode) for mode in Mode}
    stops = {reason.value: state.stops.get(reason, 0) for reason in StopReason}
    refused = {code.value: services.hub.refused[code] for code in ErrorCode}
    turned_away = dict(sorted(services.gateway.refused.items()))
    yield _one(Gauge, "loop_rate_hz", "New camera frames per second", state.cycle_hz)
    yield _one(Counter, "loop_turns_total", "Ticks of the control loop", state.cycles)
    yield _one(Counter, "loop_late_cycles_total", "Ticks that were late", state.late_cycles)
    yield _one(Gauge, "loop_age_seconds", "Time since the last tick", age_s)
    yield _many(Gauge, "mode", "1 for the robot's current mode, else 0", "mode", modes)
    yield _one(Gauge, "emergency", "1 while an emergency stop is latched", int(state.emergency))
    yield _many(Counter, "stops_total", "Stops by reason", "reason", stops)
    yield _one(Gauge, "pages", "Open control sockets", len(broadcast.clients))
    yield _one(Gauge, "viewers", "Browsers that see the picture", video.viewers)
    yield _one(Counter, "frames_sent_total", "Frames sent to viewers", video.frames_sent)
    yield _one(Counter, "frames_encoded_total", "Frames encoded for viewers", video.frames_encoded)
    yield Histogram(
        "drivelesson_frame_age_seconds",
        "Time from a frame's capture until a viewer has acknowledged it",
        buckets=[
            (str(bound), count)
            for bound, count in zip((*ages.bounds, "+Inf"), accumulate(ages.counts), strict=True)
        ],
        sum_value=ages.total,
    )
    if state.link.age_s is not None:
        text = "Age of the picture that the pilot acts upon"
        yield _one(Gauge, "pilot_frame_age_seconds", text, state.link.age_s)
    text = "Refused websocket messages by code"
    yield _many(Counter, "messages_refused_total", text, "code", refused)
    text = "Refused requests and websockets by reason"
    yield _many(Counter, "requests_refused_total", text, "reason", turned_away)
    times = Summary(
        "drivelesson_learner_seconds",
        "Time that the learner has worked, by kind of work",
        labels=["work"],
    )
    for work, timing in state.learner_times.items():
        times.add_metric([work], timing.count, timing.total_s)
    yield times


def _one(kind: Any, name: str, text: str, value: float) -> Any:
    return kind(f"drivelesson_{name}", text, value=value)


def _many(kind: Any, name: str, text: str, label: str, values: Mapping[str, float]) -> Any:
    family = kind(f"drivelesson_{name}", text, labels=[label])
    for key, value in values.items():
        family.add_metric([key], value)
    return family
