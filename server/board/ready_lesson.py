"""Makes the model "left turns only" for a lesson; this model was never taught a right turn.

The model is taught in the simulator when a class needs it. The model therefore always fits the
learner of this version, and no model file has to be shipped.
"""

from __future__ import annotations

import locale
import re
from collections.abc import Mapping
from dataclasses import replace
from functools import cache

from robot.clock import RealClock

NAME = "left turns only"
"""Name of the model, unless the computer's language is Spanish or Chinese."""
_NAMES = {"es": "solo izquierda", "spanish": "solo izquierda"}
_NAMES |= {"zh": "只会左转", "chinese": "只会左转"}
_STEP_S = 0.1
"""Simulated time between two pictures, in seconds."""
_NEAR_M, _FREE_M = 0.35, 0.5
"""Distances to the wall ahead at which a left turn begins and at which it ends, in metres."""


def locale_of_computer(environment: Mapping[str, str]) -> str | None:
    """Return the name of this computer's locale.

    Environment variables such as LANG are read first. If the chosen locale is not installed,
    Python's `getlocale` returns a different one.
    """
    chosen = (environment.get(name) for name in ("LC_ALL", "LC_MESSAGES", "LANG"))
    return next(filter(None, chosen), None) or locale.getlocale()[0]


def name_of_left_turns(locale_name: str | None) -> str:
    """Return the model's name in the language of a locale, such as es_ES or Spanish_Spain."""
    language = re.split(r"[_.@]", (locale_name or "").lower())[0]
    return _NAMES.get(language, NAME)


@cache
def left_turns(world: str = "box", seconds: float = 90.0) -> bytes:
    """Return the bytes of a model that a program has taught in a simulated world, by driving
    rounds with left turns only."""
    from robot.policy.history import TrainingHistory
    from robot.policy.registry import make_policy
    from robot.simulator.camera import SimCamera, SimCameraOptions
    from robot.simulator.driver import SimDriver, SimOptions
    from robot.store.models.model import encode_model, take_model
    from robot.types import Action, Example

    body = SimDriver(SimOptions(world=world))
    body.connect()
    camera = SimCamera(body, SimCameraOptions(), RealClock())
    history = TrainingHistory(make_policy("default-32"))
    held = Action.FORWARD
    for step in range(round(seconds / _STEP_S)):
        free_m, at_s = body.sense().distance_m or _FREE_M, step * _STEP_S
        is_near = free_m < (_FREE_M if held is Action.LEFT else _NEAR_M)
        held = Action.LEFT if is_near else Action.FORWARD
        frame = replace(camera.take_jpeg(), captured_s=at_s)
        x = history.policy.extract(frame)
        history.policy.propose(frame.frame_id, x, under_way=held, at_s=at_s)
        example = Example(frame_id=frame.frame_id, label=held, is_intervention=False)
        history.teach(example, x, at_s)
        body.drive(held)
        body.advance(_STEP_S)
    body.disconnect()
    body.simulation.close()
    now_s = RealClock().wall_s()
    return encode_model(take_model(history.policy, history.taught, saved_at_s=now_s))
