"""`/api/teaching`: the training progress, and undo of the latest. See docs/reference/http.md."""

from __future__ import annotations

import asyncio
import math
from base64 import b64encode
from collections import Counter
from typing import Any

import numpy as np
from fastapi import APIRouter, Depends, HTTPException, Request
from numpy.typing import NDArray

from robot.control.readiness import Readiness
from robot.policy.history import UNDO_HORIZON_S, TrainingHistory
from robot.policy.image import to_small_grey
from robot.policy.png import encode_png
from robot.types import Frame
from server.routes.bodies import read_body
from server.security.guard import require_pilot, require_viewer
from server.services import services_of

router = APIRouter(prefix="/api/teaching")
VIEWER, PILOT = Depends(require_viewer), Depends(require_pilot)
_STRIP = 24
"""How many frames a strip shows at most."""


@router.get("", dependencies=[VIEWER])
def describe_teaching(request: Request) -> dict[str, Any]:
    """Return what was taught, and the curve of agreement over the examples."""
    state = services_of(request).robot.loop.state
    return {
        "lessons": sum(state.taught.values()),
        "taught": {move.value: state.taught.get(move, 0) for move in state.moves},
        "agreement": state.agreement,
        "history": [
            [mark.n_examples, round(mark.agreement, 4)]
            for mark in services_of(request).progress.history()
        ],
    }


@router.get("/readiness", dependencies=[VIEWER])
async def show_readiness(request: Request, pictures: bool = True) -> dict[str, Any]:
    """Return whether the robot is ready to drive alone, or what is missing and where."""
    services = services_of(request)
    readiness = services.progress.readiness
    loop = services.robot.loop
    return await asyncio.wrap_future(loop.submit(lambda: _describe_readiness(readiness, pictures)))


@router.get("/last", dependencies=[VIEWER])
async def show_last(request: Request, seconds: float = 5.0) -> dict[str, Any]:
    """Return the examples that undoing the last seconds would remove."""
    loop = services_of(request).robot.loop
    wanted_s = _checked(seconds)
    return dict(await asyncio.wrap_future(loop.submit(lambda: _preview(loop.history, wanted_s))))


@router.post("/undo", dependencies=[PILOT])
async def undo(request: Request) -> dict[str, Any]:
    """Undo the last seconds of training: {seconds}."""
    seconds = _checked((await read_body(request)).get("seconds"))
    gone = await services_of(request).change_learner(lambda history: history.undo(seconds))
    return {"undone": len(gone)}


def _describe_readiness(readiness: Readiness, has_pictures: bool) -> dict[str, Any]:
    """Describe it; on the loop's thread."""
    return {
        "stage": readiness.stage.value,
        "alone_s": round(readiness.clean_s, 1),
        "alone_needed_s": math.ceil(readiness.needed_s),
        "unknown_share": round(readiness.novel_share, 3),
        **readiness.foreseen,
        "moves": [move.value for move in readiness.moves_in_use],
        "missing": [
            {
                "kind": gap.kind.value,
                "move": gap.move and gap.move.value,
                "instead": gap.instead and gap.instead.value,
                "have": round(gap.have, 1),
                "need": gap.need,
                "distance_m": gap.distance_m,
                "png": _encoded(gap.frame) if gap.frame and has_pictures else None,
            }
            for gap in readiness.missing()
        ],
    }


def _encoded(frame: Frame) -> str:
    return b64encode(encode_png(_picture(frame))).decode()


def _picture(frame: Frame) -> NDArray[np.uint8]:
    return to_small_grey(frame, frame.width // 2, frame.height // 2)


def _checked(seconds: Any) -> float:
    if isinstance(seconds, bool) or not isinstance(seconds, int | float):
        raise HTTPException(400, "'seconds' must be a number.")
    if not 0 < seconds <= UNDO_HORIZON_S:
        raise HTTPException(400, f"'seconds' must be between 0 and {UNDO_HORIZON_S:.0f}.")
    return float(seconds)


def _preview(history: TrainingHistory, seconds: float) -> dict[str, Any]:
    """Describe the examples that undo would remove; on the loop's thread."""
    taught = history.last_examples(seconds)
    step = max(1, -(-len(taught) // _STRIP))
    labels = Counter(event.example.label for event in taught)
    picture = history.policy.features.thumbnail
    return {
        "lessons": len(taught),
        "taught": {move.value: labels[move] for move in history.policy.moves},
        "strip": [
            {
                "frame": event.example.frame_id,
                "label": event.example.label.value,
                "is_intervention": event.example.is_intervention,
                "png": b64encode(encode_png(picture(event.x))).decode(),
            }
            for event in taught[::step]
        ],
    }
