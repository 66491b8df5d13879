"""`/api/settings`: the settings that the page can change. See docs/reference/http.md."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from fastapi import APIRouter, Depends, HTTPException, Request
from starlette.concurrency import run_in_threadpool

from robot.clock import Clock, RealClock
from robot.control.loop import ControlLoop
from robot.driver import describe
from robot.policy.registry import make_policy, split_name
from robot.types import Action, Encoding, Frame
from server.identity import COLOURS
from server.routes.bodies import do, read_body, refusals
from server.security.guard import require_pilot, require_viewer
from server.services import persistence_of, services_of

router = APIRouter(prefix="/api/settings")
VIEWER, PILOT = Depends(require_viewer), Depends(require_pilot)
SIZES = (16, 32, 64, 128, 256)
"""Numbers of learned images that a person may choose from."""
SLOWEST, FASTEST = 0.3, 1.0
_TRIALS = 10
_REAL = RealClock()


@router.get("", dependencies=[VIEWER])
async def describe_settings(request: Request) -> dict[str, Any]:
    """Return the settings and their possible values."""
    robot = services_of(request).robot
    loop: ControlLoop = robot.loop
    state = loop.state
    kind, _ = split_name(state.learner)
    rates_hz = await run_in_threadpool(estimate_rates_hz, kind)
    frame = robot.camera.latest()
    identity = services_of(request).identity.now
    return {
        "name": identity.name,
        "colour": identity.colour,
        "colours": list(COLOURS),
        "learner": state.learner,
        "max_nodes": state.max_nodes,
        "sizes": [{"max_nodes": n, "rate_hz": round(rates_hz[n])} for n in SIZES],
        "speed": loop.speed_share,
        "moves": [move.value for move in state.moves],
        "possible_moves": [move.value for move in robot.driver.moves],
        "declared_moves": [
            move.describe() for move in describe(robot.driver.moves, robot.driver.declared_moves)
        ],
        "camera": {
            "name": robot.camera.name,
            "rate_hz": round(state.cycle_hz, 1),
            "width": frame.width if frame else None,
            "height": frame.height if frame else None,
        },
    }


@router.put("", dependencies=[PILOT])
async def change_settings(request: Request) -> dict[str, Any]:
    """Set {speed, name, colour}; {max_nodes} or {moves} start an empty model, 409 if it drives."""
    body = await read_body(request)
    loop = services_of(request).robot.loop
    if "speed" in body:
        loop.speed_share = _checked_speed(body["speed"])
    if "name" in body or "colour" in body:
        await _rename(request, {key: body[key] for key in ("name", "colour") if key in body})
    if "max_nodes" in body or "moves" in body:
        kind, size = split_name(loop.state.learner)
        size = body.get("max_nodes", size)
        if isinstance(size, bool) or size not in SIZES:
            raise HTTPException(400, f"'max_nodes' must be one of {', '.join(map(str, SIZES))}.")
        moves = _checked_moves(body.get("moves", list(loop.state.moves)), request)
        autosave = persistence_of(request).autosave
        with refusals():
            await run_in_threadpool(autosave.begin, None, f"{kind}-{size}", None, moves)
    return {"learner": loop.state.learner, "speed": loop.speed_share}


async def _rename(request: Request, fields: dict[str, Any]) -> None:
    services = services_of(request)
    now = await do(lambda: services.identity.change(**fields))
    services.hub.name = now.name
    services.events.publish("renamed", robot=now.name, colour=now.colour)


def _checked_speed(speed: Any) -> float:
    if isinstance(speed, bool) or not isinstance(speed, int | float):
        raise HTTPException(400, "'speed' must be a number.")
    if not SLOWEST <= speed <= FASTEST:
        raise HTTPException(400, f"'speed' must be between {SLOWEST} and {FASTEST}.")
    return float(speed)


def _checked_moves(moves: Any, request: Request) -> tuple[Action, ...]:
    possible = services_of(request).robot.driver.moves
    if not isinstance(moves, list) or not set(moves) <= {move.value for move in possible}:
        raise HTTPException(400, f"'moves' must be some of {', '.join(possible)}.")
    if len(set(moves)) < 2:
        raise HTTPException(400, "A robot needs at least two moves to choose from.")
    return tuple(move for move in possible if move.value in moves)


@lru_cache(maxsize=8)
def estimate_rates_hz(kind: str) -> dict[int, float]:
    """Return how many pictures a second this machine can judge and learn, per number of images.

    Two sizes are tried, once; the cost grows with the number of images along a straight line.
    """
    small, large = SIZES[0], SIZES[-2]
    small_s, large_s = measure_frame_s(f"{kind}-{small}"), measure_frame_s(f"{kind}-{large}")
    slope_s = max(0.0, (large_s - small_s) / (large - small))
    return {n: 1 / (small_s + slope_s * (n - small)) for n in SIZES}


def measure_frame_s(learner: str, clock: Clock = _REAL) -> float:
    """Return the seconds that one picture takes a full learner: features, proposal, learning."""
    policy = make_policy(learner)
    noise = np.random.default_rng(1)
    frames = [_noise_frame(noise, i) for i in range(4)]
    vectors = [policy.extract(frame) for frame in frames]
    varied = [v + noise.normal(0, 1, v.shape).astype(np.float32) for v in vectors]
    for i in range(policy.max_nodes + 1):
        policy.learn(np.abs(varied[i % 4] * (1 + i % 7)).astype(vectors[0].dtype), Action.FORWARD)
    start_s = clock.now_s()
    for i in range(_TRIALS):
        x = policy.extract(frames[i % 4])
        policy.propose(i, x)
        policy.learn(x, Action.FORWARD)
    return (clock.now_s() - start_s) / _TRIALS


def _noise_frame(noise: np.random.Generator, frame_id: int) -> Frame:
    data = noise.integers(0, 255, (120, 160, 3), dtype=np.uint8).tobytes()
    return Frame(
        frame_id=frame_id, captured_s=0.0, width=160, height=120, encoding=Encoding.RGB, data=data
    )
