"""`/api/why`: what the robot's present proposal rests on. See docs/reference/http.md."""

from __future__ import annotations

import asyncio
from base64 import b64encode
from typing import Any

from fastapi import APIRouter, Depends, Request

from robot.control.loop import ControlLoop
from robot.policy.explanation import Explanation, explain
from robot.policy.png import encode_png
from robot.types import Prediction
from server.security.guard import require_viewer
from server.services import services_of

router = APIRouter()


@router.get("/api/why", dependencies=[Depends(require_viewer)])
async def show_why(request: Request) -> dict[str, Any]:
    """Return the image that decides now beside the present view; null if there is none."""
    loop = services_of(request).robot.loop
    found = await asyncio.wrap_future(loop.submit(lambda: _explain(loop)))
    return {"why": found and _describe(*found)}


def _explain(loop: ControlLoop) -> tuple[Prediction, Explanation] | None:
    """Explain the newest proposal; on the loop's thread."""
    newest = loop.newest
    if newest is None:
        return None
    x, prediction = newest
    explanation = explain(loop.history.policy, x, prediction.node)
    return None if explanation is None else (prediction, explanation)


def _describe(prediction: Prediction, explanation: Explanation) -> dict[str, Any]:
    return {
        "frame": prediction.frame_id,
        "action": prediction.action and prediction.action.value,
        "novelty": round(float(prediction.novelty), 3),
        "node": explanation.node_id,
        "votes": {move.value: count for move, count in explanation.votes.items()},
        "frames": explanation.frames,
        "present": b64encode(encode_png(explanation.present)).decode(),
        "image": b64encode(encode_png(explanation.image)).decode(),
        "alike": [[round(float(part), 2) for part in row] for row in explanation.alike],
    }
