"""Drives one environment in virtual time, in the Python of its package: `ENV OPTIONS STEPS FOLDER`.

Prints one line of JSON: the observations, and the faults. The first picture is saved in the folder.
"""

from __future__ import annotations

import json
import logging
import re
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from robot.bodies.gymnasium.camera import GymnasiumCamera, GymnasiumCameraOptions
from robot.bodies.gymnasium.driver import OVER_S, GymnasiumDriver, GymnasiumOptions
from robot.bodies.gymnasium.environment import Environment
from robot.devices.rig import Rig
from robot.errors import RobotError
from robot.policy.image import to_rgb
from robot.policy.registry import make_policy
from robot.testing import VirtualClock
from robot.types import Action, Mode, PilotCommand

LONGEST = 30
"""Number of steps of a game, unless its environment ends it earlier, to test the end."""
MOST_MOVES = 6
"""Number of moves that are tried; further moves of a body work in the same way."""
_CLOSE = 12.0
"""Largest mean difference of bytes due to JPEG."""


class Watched:
    """An environment, with its inputs and outputs."""

    def __init__(self, env: Any) -> None:
        self.env = env
        self.acts: list[Any] = []
        self.given: list[Any] = [None, None]
        self.takes_s: list[float] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self.env, name)

    def reset(self, **options: Any) -> Any:
        begun = self.env.reset(**options)
        self.given[0] = begun[0] if isinstance(begun, tuple) else begun
        return begun

    def step(self, action: Any) -> Any:
        self.acts.append(action)
        started_s = time.perf_counter()
        outcome = self.env.step(action)
        self.takes_s.append(time.perf_counter() - started_s)
        self.given[0] = outcome[0]
        return outcome

    def render(self, **options: Any) -> Any:
        self.given[1] = self.env.render(**options)
        return self.given[1]


class WatchedDriver(GymnasiumDriver):
    """The driver, whose environment can be inspected."""

    watched: Watched

    def _make(self) -> Environment:
        made = super()._make()
        made.env = self.watched = Watched(made.env)
        return made


def hold(rig: Rig, move: Action | None, seconds: float) -> None:
    """Hold a move, ten commands a second."""
    for _ in range(round(seconds / 0.1)):
        frame, now_s = rig.camera.latest(), rig.clock.now_s()
        assert frame is not None
        held = PilotCommand(
            held=move, frame_id=frame.frame_id, seq=round(now_s * 1000), received_s=now_s
        )
        rig.loop.command(held)
        rig.clock.sleep(0.1)


def choose(rig: Rig, mode: Mode) -> None:
    assert rig.clock.result(rig.loop.set_mode(mode), 5.0), f"{mode} was refused"


def drive(name: str, options: str, steps: int, folder: Path) -> dict[str, Any]:
    """Return the observations of an environment; `wrong` names the faults."""
    clock = VirtualClock(100.0)
    told: dict[str, Any] = {"env": name, "wrong": []}
    wrong = told["wrong"]
    body = WatchedDriver(GymnasiumOptions(env=name, env_options=options, env_steps=steps))
    space = body.watched.action_space
    told["moves"] = list(body.moves)
    camera = GymnasiumCamera(body, GymnasiumCameraOptions(), clock)
    rig = Rig(body, camera, make_policy("default-32", moves=body.first_moves), clock)
    with rig:
        frame, watched, loop = camera.latest(), body.watched, rig.loop
        assert frame is not None
        told["picture"] = f"{frame.width}x{frame.height}"
        kept = folder / (re.sub(r"\W+", "-", name.split(":")[-1]) + ".jpg")
        kept.write_bytes(frame.data)
        told["equals"] = _equals(to_rgb(frame), watched.given)
        if told["equals"] is False:
            wrong.append("its picture is not what the environment gave")
        choose(rig, Mode.TRAIN)
        ends = []
        loop.subscribe(lambda tick: ends.append(tick.sensors.game))
        for move in body.moves[:MOST_MOVES]:
            n_acts = len(watched.acts)
            hold(rig, move, 0.4)
            if len(watched.acts) == n_acts:  # the end of a game should have come by then
                hold(rig, move, OVER_S + 0.6)
            acts = watched.acts[n_acts:]
            if not any(_same(act, body._actions[move]) for act in acts):
                wrong.append(f"{move} was not what the environment got")
            if not all(space.contains(act) for act in acts):
                wrong.append(f"{move} is no action")
        hold(rig, body.moves[min(len(body.moves), MOST_MOVES) - 1], LONGEST * 0.1 + OVER_S)
        games = [game for game in ends if game is not None]
        told["end"] = any(game.is_over for game in games)
        told["games"] = max(game.number for game in games)
        taught = loop.state.taught
        told["taught"] = sum(taught.values())
        wrong.extend(
            f"{move} was not learned" for move in body.moves[:MOST_MOVES] if not taught[move]
        )
        choose(rig, Mode.AUTONOMOUS)
        n_acts = len(watched.acts)
        hold(rig, None, 2.0)
        told["driven"] = len(watched.acts) - n_acts
        if loop.state.stops or loop.state.fault:
            wrong.append(f"{dict(loop.state.stops)} {loop.state.fault}")
        if not told["driven"]:
            wrong.append("the robot did not drive")
        told["step_ms"] = round(1000 * float(np.median(watched.takes_s)), 1)
    return told


def _equals(picture: Any, given: list[Any]) -> bool | None:
    """Return whether a picture is among the outputs; None if no output has a plain form."""
    found: list[Any] = []

    def look(part: Any) -> None:
        if isinstance(part, dict):
            for one in part.values():
                look(one)
        elif getattr(part, "dtype", None) == np.uint8 and part.shape == picture.shape:
            found.append(np.abs(part.astype(float) - picture).mean())

    for part in given:
        look(part)
    return bool(min(found) < _CLOSE) if found else None


def _same(one: Any, other: Any) -> bool:
    if isinstance(other, dict):
        return all(_same(one[key], other[key]) for key in other)
    if isinstance(other, tuple):
        return all(map(_same, one, other))
    return bool(np.array_equal(one, other))


def main() -> None:
    name, options, steps, folder = sys.argv[1:5]
    warnings.simplefilter("ignore")
    logging.disable(logging.WARNING)
    try:
        told = drive(name, options, int(steps), Path(folder))
    except RobotError as error:
        told = {"env": name, "refused": str(error)}
    print("\nWORLD " + json.dumps(told))


if __name__ == "__main__":
    main()
