"""The control loop's state as a `state` message carries it. Pure."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from robot.control.camera_timing import CameraState
from robot.control.state import LoopState
from robot.driver import Driver, describe
from robot.types import Mode, Point, Pose, Prediction, Sensors

STATE_EVERY_S = 0.1
_SOON_S = 0.05


def state_every_s(state: LoopState) -> float:
    """Return how often the state is sent: oftener while a robot with a slow camera moves.

    Its pictures alone bring the pilot too few nonces, and a short pause of the Wi-Fi would look
    like a pilot who is gone.
    """
    is_slow = state.camera.period_s > _SOON_S and state.decision.mode is not Mode.STOPPED
    return _SOON_S if is_slow else STATE_EVERY_S


def _brick_age_s(camera: CameraState) -> float | None:
    """Return what a camera on a brick is late by for the brick and the line to it."""
    source_s = camera.source_age_s
    return None if source_s is None else max(0.0, camera.delivery_age_s - source_s)


def describe_state(state: LoopState, now_ms: float) -> dict[str, Any]:
    """Return the fields of a `state` message that come from the control loop."""
    decision = state.decision
    return {
        "server_ms": round(now_ms, 1),
        "mode": decision.mode.value,
        "driven_by": decision.driven_by.value,
        "action": decision.action.value,
        "point": _describe_point(decision.point),
        "speed_scale": decision.speed_scale,
        "stop_reason": decision.stop_reason.value if decision.stop_reason else None,
        "emergency": state.emergency,
        "asks_pilot": decision.asks_pilot,
        "fault": state.fault,
        "frame": state.frame_id,
        "frame_age_ms": _milliseconds(_age_s(state, now_ms)),
        "link": state.link.value,
        "busy": state.is_busy,
        "camera": {
            "period_ms": _milliseconds(state.camera.period_s),
            "age_ms": _milliseconds(state.camera.delivery_age_s),
            "brick_ms": _milliseconds(_brick_age_s(state.camera)),
            "limit_ms": _milliseconds(state.camera.timeout_s),
            "speed_scale": _rounded(state.camera.speed_scale),
        },
        "pilot_frame_age_ms": _milliseconds(state.pilot_frame_age_s),
        "cycle_hz": round(state.cycle_hz, 1),
        "prediction": _describe_prediction(state.prediction),
        "agreement": None if state.agreement is None else round(state.agreement, 4),
        "agreement_frames": state.agreement_frames,
        "taught": {move.value: state.taught.get(move, 0) for move in state.moves},
        "lessons": sum(state.taught.values()),
        "nodes": state.n_nodes,
        "max_nodes": state.max_nodes,
        "learner": state.learner,
        **_describe_sensors(state.sensors),
    }


def describe_body(driver: Driver) -> dict[str, Any]:
    """Return what a page is told of what the body can do."""
    moves = describe(driver.moves, driver.declared_moves)
    return {
        "declared_moves": [move.describe() for move in moves],
        "takes_points": driver.takes_points,
    }


def _age_s(state: LoopState, now_ms: float) -> float | None:
    return None if state.frame_captured_s is None else now_ms / 1000 - state.frame_captured_s


def _milliseconds(seconds: float | None) -> float | None:
    return None if seconds is None else round(seconds * 1000, 1)


def _describe_prediction(prediction: Prediction | None) -> dict[str, Any] | None:
    if prediction is None:
        return None
    return {
        "frame": prediction.frame_id,
        "action": prediction.action.value if prediction.action else None,
        "confidence": _rounded(prediction.confidence),
        "novelty": _rounded(prediction.novelty),
        "probabilities": {
            action.value: _rounded(share) for action, share in prediction.probabilities.items()
        },
        "node": prediction.node,
        "distance": _rounded(prediction.distance),
        "point": _describe_point(prediction.point),
        "spread": None if prediction.spread is None else _rounded(prediction.spread),
    }


def _describe_point(point: Point | None) -> dict[str, float] | None:
    return point and {name: _rounded(share) for name, share in point._asdict().items()}


def _describe_sensors(sensors: Sensors) -> dict[str, Any]:
    return {
        "distance_m": None if sensors.distance_m is None else _rounded(sensors.distance_m),
        "bumped": None if sensors.bumped is None else bool(sensors.bumped),
        "bumpers": [bool(pressed) for pressed in sensors.bumpers],
        "battery": None if sensors.battery_share is None else _rounded(sensors.battery_share),
        "pose": _describe_pose(sensors.pose),
        **({} if sensors.game is None else {"game": asdict(sensors.game)}),
    }


def _describe_pose(pose: Pose | None) -> dict[str, float | bool] | None:
    if pose is None:
        return None
    return {
        "x_m": _rounded(pose.x_m),
        "y_m": _rounded(pose.y_m),
        "heading_rad": _rounded(pose.heading_rad),
        "is_estimate": pose.is_estimate,
    }


def _rounded(value: float) -> float:
    """Round to four places, which is enough for a page; numpy's numbers become Python's."""
    return round(float(value), 4)
