"""Converts the state of the control loop to the fields of a `state` message. Pure."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from robot.camera import Camera
from robot.control.state import Tick
from robot.driver import Driver
from robot.moves import describe
from robot.types import Prediction

STATE_EVERY_S = 0.1
SOON_S = 0.05
"""Interval of the states in seconds, if the robot moves and its camera's period is longer. Without
these states and their nonces, a short Wi-Fi pause would look like an absent pilot."""


def describe_state(state: Tick, now_ms: float) -> dict[str, Any]:
    """Return the fields of a `state` message; `frame` is None while the robot rests."""
    decision, camera, sensors = state.decision, state.camera, state.sensors
    captured_s = None if state.is_resting else state.frame_captured_s
    source_s = state.source_age_s
    # the delay that the brick and its connection add to that of the camera
    brick_s = None if source_s is None else max(0.0, camera.delivery_age_s - source_s)
    fields = {
        "server_ms": round(now_ms, 1),
        "mode": decision.mode,
        "driven_by": decision.driven_by,
        "action": decision.action,
        "point": decision.point and decision.point._asdict(),
        "speed_scale": decision.speed_scale,
        "stop_reason": decision.stop_reason,
        "emergency": state.emergency,
        "asks_pilot": decision.asks_pilot,
        "fault": state.fault,
        "frame": None if state.is_resting else state.frame_id,
        "frame_age_ms": None if captured_s is None else _milliseconds(now_ms / 1000 - captured_s),
        "link": state.link.level,
        "busy": state.link.is_busy,
        "camera": {
            "period_ms": _milliseconds(camera.period_s),
            "age_ms": _milliseconds(camera.delivery_age_s),
            "brick_ms": _milliseconds(brick_s),
            "limit_ms": _milliseconds(camera.timeout_s),
            "speed_scale": camera.speed_scale,
        },
        "pilot_frame_age_ms": _milliseconds(state.link.age_s),
        "cycle_hz": round(state.cycle_hz, 1),
        "prediction": state.prediction and _describe_prediction(state.prediction),
        "agreement": state.agreement,
        "agreement_frames": state.agreement_frames,
        "taught": {move: state.taught.get(move, 0) for move in state.moves},
        "lessons": sum(state.taught.values()),
        "nodes": state.n_nodes,
        "max_nodes": state.max_nodes,
        "learner": state.learner,
        "distance_m": sensors.distance_m,
        "bumped": None if sensors.bumped is None else bool(sensors.bumped),
        "bumpers": [bool(pressed) for pressed in sensors.bumpers],
        "battery": sensors.battery_share,
        "pose": sensors.pose and asdict(sensors.pose),
        **({} if sensors.game is None else {"game": asdict(sensors.game)}),
    }
    return {name: _rounded(value) for name, value in fields.items()}


def describe_body(driver: Driver) -> dict[str, Any]:
    moves = [move.describe() for move in describe(driver.moves, driver.declared_moves)]
    return {"declared_moves": moves, "takes_points": bool(driver.takes_points)}


def describe_devices(driver: Driver, camera: Camera) -> dict[str, str]:
    """Return the names of the body and the camera, if a search has found them."""
    found: dict[str, str] = {}
    for name, part in (("device", driver), ("camera_device", camera)):
        with contextlib.suppress(Exception):  # `device` may be a plugin's property, which may fail
            device = part.device
            found |= {name: device} if device and isinstance(device, str) else {}
    return found


def _milliseconds(seconds: float | None) -> float | None:
    return None if seconds is None else round(seconds * 1000, 1)


def _describe_prediction(prediction: Prediction) -> dict[str, Any]:
    same = ("action", "confidence", "novelty", "probabilities", "node", "distance", "spread")
    return {
        "frame": prediction.frame_id,
        "point": prediction.point and prediction.point._asdict(),
        **{name: getattr(prediction, name) for name in same},
    }


def _rounded(value: Any) -> Any:
    """Round numbers to four decimal places, and convert numpy's numbers to Python's."""
    if value is None or isinstance(value, str | int | list):
        return value
    if not isinstance(value, float) and isinstance(value, Mapping):
        return {key: _rounded(part) for key, part in value.items()}
    return round(float(value), 4) if math.isfinite(value) else None  # JSON has no infinity
