"""Gymnasium environments as robots, with every form of moves, pictures and games."""

from __future__ import annotations

import enum
import os
import re
import sys
from types import SimpleNamespace as Kept
from typing import Any

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="NOT TESTED: Gymnasium is not installed")

import gymnasium

from robot.bodies.gymnasium.actions import moves_of
from robot.bodies.gymnasium.camera import GymnasiumCamera, GymnasiumCameraOptions
from robot.bodies.gymnasium.driver import OVER_S, GymnasiumDriver, GymnasiumOptions
from robot.bodies.gymnasium.environment import Environment, render_without_a_screen
from robot.bodies.gymnasium.pictures import describe, picture_in
from robot.control.loop import ControlLoop
from robot.devices.rig import Rig
from robot.errors import CameraError, ConfigurationError
from robot.policy.image import to_rgb
from robot.policy.registry import make_policy
from robot.testing import VirtualClock
from robot.types import Action, Mode, PilotCommand, Point
from tests.kit.sizes import crossed
from tests.server.virtual_server import VirtualServer
from tests.standins.gymnasium_line import Line
from tests.standins.odd_environments import (
    ACTIONS,
    BANDS,
    BEHAVIOURS,
    FORMS,
    NO_PICTURES,
    REWARDS,
    UNDRIVABLE,
    truth,
)

Way = enum.IntEnum("Way", {"LEFT": 0, "RIGHT": 1, "FORWARD": 2})
GAME = Kept(
    get_available_buttons=lambda: [Kept(name=name) for name in ("LOOK", "TURN_LEFT", "ATTACK")]
)
LINE = "tests.standins.gymnasium_line:Line"


def driver(env: str = LINE, **options: Any) -> GymnasiumDriver:
    return GymnasiumDriver(GymnasiumOptions(env=env, **options))


@pytest.mark.parametrize(
    ("kept", "start", "names"),
    [
        ({"get_action_meanings": lambda: ["A", "LEFT", "left!"]}, 0, "a left left_2"),
        ({"get_action_meanings": lambda: ["STOP", "noop", "up"]}, 0, "noop noop_2 forward"),
        ({}, -1, "move_minus_1 move_0 move_1"),
        ({"action_names": ["<<", "", "-1"]}, 0, "move move_1 move_1_2"),
        ({"action_names": ["a" * 40, "a" * 50, "a"]}, 0, f"{'a' * 32} {'a' * 30}_2 a"),
        ({"actions": Way}, 0, "left right forward"),
        ({"actions": {"right": 2, "left": 0, "done": 9}}, 0, "left move_1 right"),
        (
            {"action_type": Kept(actions={0: "LANE_LEFT", 2: "FASTER"})},
            0,
            "lane_left move_1 faster",
        ),
        ({"ACTION_LOOKUP": {-1: "push", 0: "pull", 1: "wait"}}, -1, "push pull wait"),
        ({"actions": ("only one",), "action_names": ["x", "y", "z"]}, 0, "x y z"),
        ({"get_action_meanings": lambda: 1 / 0}, 0, "move_0 move_1 move_2"),
        ({"button_map": [[0, 0], [0, 1], [1, 1]], "game": GAME}, 0, "noop attack left_attack"),
    ],
)
def test_names_of_moves_are_taken_from_the_environment_and_none_is_lost(
    kept: dict[str, Any], start: int, names: str
) -> None:
    env = gymnasium.Env[Any, Any]()
    env.action_space = gymnasium.spaces.Discrete(3, start=start)
    for name, value in kept.items():
        setattr(env, name, value)
    found = moves_of("any", env)
    assert " ".join(move.name for move in found) == names
    assert list(found.values()) == [start, start + 1, start + 2]


def test_buttons_have_names_and_a_wrapper_that_changes_the_actions_has_its_own() -> None:
    env = gymnasium.Env[Any, Any]()
    env.action_space = gymnasium.spaces.MultiBinary(3)
    env.buttons = ["B", None, "LEFT"]
    assert [move.name for move in moves_of("any", env)] == ["rest", "b", "button_2", "left"]
    chosen = gymnasium.spaces.Discrete(2)
    wrapped = gymnasium.wrappers.TransformAction(env, lambda i: [[1, 0, 0], [0, 0, 1]][i], chosen)
    assert [move.name for move in moves_of("any", wrapped)] == ["move_0", "move_1"]


def test_libraries_that_draw_need_no_screen_and_a_person_s_choice_stays(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mine = {"DISPLAY": "", "WAYLAND_DISPLAY": "", "MUJOCO_GL": "", "SDL_VIDEODRIVER": "x11"}
    environ = {name: value for name, value in mine.items() if value}
    monkeypatch.setattr(os, "environ", environ)
    monkeypatch.setattr(sys, "platform", "linux")
    render_without_a_screen()
    assert environ["MUJOCO_GL"] in ("egl", "osmesa")
    assert environ["PYOPENGL_PLATFORM"] == environ["MUJOCO_GL"]
    assert environ["PYGLET_HEADLESS"] == "1" and environ["SDL_VIDEODRIVER"] == "x11"
    for system, screen in (("linux", {"DISPLAY": ":0"}), ("darwin", {}), ("win32", {})):
        monkeypatch.setattr(os, "environ", {**screen})
        monkeypatch.setattr(sys, "platform", system)
        render_without_a_screen()
        assert os.environ == screen


def test_moves_have_the_environments_own_names_and_sides_or_those_of_a_table() -> None:
    moves = driver().declared_moves
    assert [move.name for move in moves] == ["noop", "left", "right"]
    assert [move.steering for move in moves] == [0.0, -1.0, 1.0]
    assert moves[0].throttle == 0.0
    table = "hard_left=-1,0; ease_right = 0.25,0.5"
    body = driver(env_options="form=box", env_moves=table)
    assert body.moves == ("hard_left", "ease_right")
    assert [move.steering for move in body.declared_moves] == [-1.0, 1.0]
    np.testing.assert_array_equal(body._actions[Action("ease_right")], np.float32([0.25, 0.5]))


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"env_options": "form=box", "env_moves": "left=1; right=2"}, "has 1 number; .* 2 numbers"),
        ({"env_options": "form=box", "env_moves": "left=-1,0; right=7,0"}, "right=7,0"),
        ({"env_moves": "left=1; right=3"}, "right=3"),
        ({"env_moves": "left=1; left=2"}, "left=2"),
        ({"env_moves": "left=1; Right=2"}, "Right=2"),
        ({"env_moves": "left=1"}, "two moves"),
        ({"env": "NoSuch-v0"}, "NoSuch-v0"),
        ({"env": "no_such_module:Env"}, "no_such_module"),
        ({"env": "types:SimpleNamespace"}, "it has no action space"),
        ({"env_options": "height"}, "NAME=VALUE"),
        ({"env_options": "weather=bad"}, "weather"),
    ],
)
def test_impossible_options_are_refused_with_their_reason(
    options: dict[str, Any], says: str
) -> None:
    with pytest.raises(ConfigurationError, match=says):
        driver(**options)


def test_a_car_that_races_is_steered_proportionally() -> None:
    pytest.importorskip("Box2D", reason="NOT TESTED: Box2D is not installed")
    body = GymnasiumDriver(GymnasiumOptions())
    assert body.takes_points and body._action_at is not None
    for point, action, move in (
        (Point(0.0, 0.5), (0, 0.3, 0), "forward"),
        (Point(-1.0, 0.5), (-0.6, 0.1, 0), "left"),
        (Point(0.5, 0.5), (0.3, 0.2, 0), "right"),
        (Point(0.0, 1.0), (0, 0.6, 0), "forward"),
        (Point(0.1, -0.5), (0.06, 0, 0.5), "brake"),
        (Point(0.0, -1.0), (0, 0, 1), "brake"),
        (Point(0.0, 0.0), (0, 0, 0), "coast"),
    ):
        assert body._action_at(point) == pytest.approx(action, abs=1e-6), point
        assert body.move_of(point) == move
    assert not GymnasiumDriver(GymnasiumOptions(env_options="continuous=false")).takes_points


@pytest.mark.parametrize(
    ("options", "shape"),
    [
        ({}, (120, 84, 3)),
        ({"env_picture": "observed"}, (40, 84, 3)),
        ({"env_options": "height=120,width=50"}, (120, 200, 3)),
        ({"env_options": "form=blind"}, (120, 84, 3)),
    ],
)
def test_pictures_are_observations_or_else_renderings(
    options: dict[str, Any], shape: tuple[int, ...]
) -> None:
    body = driver(**options)
    assert body.picture().shape == shape
    body.close()


@pytest.mark.parametrize(
    ("picture", "render", "says"),
    [
        ("observed", Line.render, "it observes float32 of shape 1, and try --env-picture rendered"),
        ("auto", lambda _: 1 / 0, "it observes .*, and rendering failed: division by zero"),
        ("rendered", lambda _: None, "gives no picture: it renders nothing"),
    ],
)
def test_an_environment_without_the_wanted_picture_says_so(
    picture: str, render: Any, says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Line, "render", render)
    with pytest.raises(CameraError, match=says):
        driver(env_options="form=blind", env_picture=picture).picture()


def test_time_passes_only_during_a_move_and_a_new_game_follows_the_last() -> None:
    with driver(env_seed=3) as body:
        before = body.picture()
        body.advance(1.0)
        assert (body.picture() == before).all()
        n = 0
        while not (body.sense().game and body.sense().game.is_over):
            body.send_action(Action("right"))
            body.advance(0.1)
            n += 1
        game = body.sense().game
        assert game is not None
        assert (game.number, game.score, game.reward) == (1, 9.0 - (n - 1), 9.0)
        for _ in range(round(OVER_S / 0.1)):
            assert body.sense().game == game, "the end of a game stays visible for a while"
            body.send_action(Action("right"))
            body.advance(0.1)
        game = body.sense().game
        assert game is not None and (game.number, game.is_over, game.score) == (2, False, 0.0)
        body.close()


def test_a_game_that_ends_in_black_shows_the_picture_before(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """ViZDoom's last observation of a game has only zeros. All steps return the same array."""
    array = np.zeros((40, 84, 3), np.uint8)

    def see(line: Line) -> Any:
        array[:] = line.render()[:40] if 0 < line.place < line.width - 1 else 0
        return array

    monkeypatch.setattr(Line, "_see", see)
    with driver(env_picture="observed") as body:
        before = body.picture().copy()
        for _ in range(99):
            body.send_action(Action("right"))
            body.advance(0.1)
            game = body.sense().game
            assert game is not None
            if game.is_over:
                break
            before = body.picture().copy()
        assert not array.any() and before.any()
        assert (body.picture() == before).all()
        body.advance(OVER_S)
        game = body.sense().game
        assert game is not None and (game.number, game.is_over) == (2, False)
        assert (body.picture() == array).all() and array.any()
        body.close()


def test_a_slow_computer_neither_stops_the_robot_nor_misses_a_step() -> None:
    """The environment advances only with the loop's ticks, each of which takes 0.45 s."""
    clock, body, seen = VirtualClock(), driver(), list[int]()
    camera = GymnasiumCamera(body, GymnasiumCameraOptions(), clock)
    loop = ControlLoop(body, camera, make_policy("knn-1", body.moves), clock)
    with body, camera:
        while len(seen) < 93 and not (loop.state.sensors.game and loop.state.sensors.game.is_over):
            clock.wait(loop.wake, 0.05)
            loop.wake.clear()
            frame, now_s, seq = camera.latest(), clock.now_s(), len(seen)
            assert frame is not None
            if seq == 3:
                loop.set_mode(Mode.TRAIN)
            held = Action("right") if seq >= 3 else None
            loop.command(
                PilotCommand(held=held, frame_id=frame.frame_id, seq=seq, received_s=now_s)
            )
            loop.tick(now_s)
            seen.append(int(to_rgb(frame).max(axis=(0, 2)).argmax()))
            clock.sleep(0.45)
            decision = loop.state.decision
            assert seq < 3 or decision.mode is Mode.TRAIN, decision.stop_reason
    steps = np.diff(list(dict.fromkeys(seen)))
    assert len(steps) > 4 and (steps > 0).all()
    assert steps.max() <= 5, "each step moves by four pixels, so no frame was missed"


@pytest.mark.parametrize("takes_s", [0.7, 3.0])
def test_a_slow_environment_does_not_stop_the_robot(
    takes_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In an earlier version, a step of 0.7 s increased the age of the pilot's picture, so the robot
    stood in 185 of 234 samples."""
    clock = VirtualClock(100.0)
    body = driver(env_options="width=2001")
    camera = GymnasiumCamera(body, GymnasiumCameraOptions(), clock)
    policy = make_policy("knn-1", body.moves)
    monkeypatch.setattr(Line, "compute", lambda _: clock.sleep(takes_s))
    with VirtualServer(rig=Rig(body, camera, policy, clock)) as server:
        pilot = server.pilot()
        pilot.mode("train")
        pilot.hold("right")
        server.forward(12 * (takes_s + 0.1))
        state = server.rig.loop.state
        assert state.stops == {} and state.decision.mode is Mode.TRAIN
        assert state.taught[Action.RIGHT] >= 9
        pilot.hold(None)
        pilot.mode("autonomous")
        server.forward(6 * (takes_s + 0.1))
        state = server.rig.loop.state
        assert state.stops == {} and state.sent is Action.RIGHT
        pilot.is_silent = True
        steps = state.frame_id or 0
        server.wait_until(lambda: server.rig.loop.state.sent is Action.STOP, 99.0)
        assert (server.rig.loop.state.frame_id or 0) - steps <= 6, "without a pilot the robot stops"


# Third-party environments ---------------------------------------------------------


@crossed(behaviour=BEHAVIOURS, reward=REWARDS)
def test_games_are_played_whatever_form_their_rewards_and_ends_have(
    behaviour: str, reward: str
) -> None:
    odd = "tests.standins.odd_environments:Odd"
    env = Environment(odd, {"behaviour": behaviour, "reward": reward}, "auto", 1)
    for number in (1, 2):
        env.reset()
        assert (env.game.number, env.game.is_over) == (number, False)
        for _ in range(3):
            assert not env.game.is_over
            env.step(1)
            assert env.game.reward == pytest.approx(REWARDS[reward][1])
        assert env.game.is_over and env.game.score == pytest.approx(
            np.clip(3 * REWARDS[reward][1], -1e12, 1e12)
        )
        assert np.array_equal(env.picture(), truth(120, 160))


@pytest.mark.parametrize("form", UNDRIVABLE)
def test_actions_that_a_person_cannot_give_are_refused_in_one_sentence(form: str) -> None:
    make, says = UNDRIVABLE[form]
    env = gymnasium.Env[Any, Any]()
    env.action_space = make()
    with pytest.raises(ConfigurationError, match=says) as refused:
        moves_of("any", env)
    assert "\n" not in str(refused.value) and len(str(refused.value)) < 600


@pytest.mark.parametrize("form", FORMS)
def test_a_picture_in_any_form_is_upright_and_has_its_colours(form: str) -> None:
    seen, space = FORMS[form](truth(48, 72))
    for one in (picture_in(seen, space), picture_in(seen)):
        assert one is not None and one.dtype == np.uint8
        height, width = one.shape[:2]
        assert one[: height // 8].mean() > 225
        for i, colour in enumerate(BANDS):
            middle = (2 * i + 1) * width // 6
            found = one[height // 2 :, middle - 1 : middle + 2].mean(axis=(0, 1))
            wanted = np.array(colour, float)
            if "grey" in form:
                wanted[:] = wanted @ [0.299, 0.587, 0.114]
            assert np.abs(found - wanted).max() < 40, (found, wanted)


@pytest.mark.parametrize("form", NO_PICTURES)
def test_an_observation_that_is_not_a_picture_is_reported_in_words(form: str) -> None:
    assert picture_in(NO_PICTURES[form]) is None
    assert 0 < len(describe(NO_PICTURES[form])) < 100


@pytest.mark.parametrize("form", ACTIONS)
def test_any_action_can_be_given_by_itself_and_in_a_table(form: str) -> None:
    env = gymnasium.Env[Any, Any]()
    env.action_space = space = ACTIONS[form]()
    moves = moves_of("any", env)
    names = [move.name for move in moves]
    assert len(set(names)) == len(names) >= 2
    assert all(space.contains(action) for action in moves.values())
    with pytest.raises(ConfigurationError) as refused:
        moves_of("any", env, "left=9999,9999,9999,9999,9999,9999,9999,9999,9999; right=0")
    example = re.search(r"--env-moves '(.*)'", str(refused.value))
    assert example is not None, str(refused.value)
    from_example = moves_of("any", env, example[1])
    assert [move.name for move in from_example] == ["left", "right"]
    assert all(space.contains(action) for action in from_example.values())
