"""Uses docs/examples/lerobot with a served robot, but without LeRobot, which the example's
connection does not need.

DRIVELESSON_FULL=1 compares 10,000 orders.
"""

import contextlib
import functools
import importlib
import random
import sys
import time
import types
from collections.abc import Iterator
from typing import Any

import pytest

from robot.moves import CLASSIC
from robot.types import Action
from server.config import Config, Limits
from tests.kit.sizes import IS_FULL
from tests.kit.wait import wait_until
from tests.server.live_robot import WEB, LiveServer, Pilot, live_server

PACKAGE = "lerobot_robot_drivelesson"
FOLDER = WEB.parent / "docs/examples/lerobot" / PACKAGE
ORDERS = 10_000 if IS_FULL else 150
MOVES = {"forward": (0.0, 0.5), "left": (-1.0, 0.5), "right": (1.0, 0.5)}
MORE = {**MOVES, "backward": (0.0, -0.5), "spin_left": (-1.0, 0.0), "spin_right": (1.0, 0.0)}


def part(name: str) -> Any:
    """Import a module of the package, whose `__init__` needs LeRobot."""
    if PACKAGE not in sys.modules:
        bare = types.ModuleType(PACKAGE)
        bare.__path__ = [str(FOLDER)]
        sys.modules[PACKAGE] = bare
    return importlib.import_module(f"{PACKAGE}.{name}")


def asks(steering: float, throttle: float | None) -> dict[str, float]:
    named = {"steering.pos": steering}
    return named if throttle is None else {**named, "throttle.vel": throttle}


@pytest.mark.parametrize(
    ("steering", "throttle", "taken", "move"),
    [
        (0.0, 0.5, MOVES, "forward"),
        (0.7, 0.9, MOVES, "right"),
        (-1.0, 0.2, MOVES, None),
        (-1.0, 0.3, MOVES, "left"),
        (0.0, -0.5, MOVES, None),
        (0.0, -0.5, MORE, "backward"),
        (-1.0, 0.0, MORE, "spin_left"),
        (0.4, 0.0, MORE, None),
        (-1.0, None, MORE, None),
        (9.0, 7.0, MOVES, "right"),
        (float("nan"), 0.5, MOVES, None),
        (0.0, float("inf"), MOVES, None),
        (0.0, 0.5, {}, None),
    ],
)
def test_an_action_counts_as_the_nearest_move_that_is_taken(steering, throttle, taken, move):
    assert part("nearest").nearest(asks(steering, throttle), taken) == move
    assert part("nearest").nearest({}, taken) is None


@pytest.fixture
def server():
    limits = Limits(messages_per_second=1e4, messages_burst=1e4)
    with live_server(Config(port=0, web=WEB, limits=limits)) as running:
        running.driver.declared_moves = tuple(CLASSIC.values())
        yield running


@contextlib.contextmanager
def line_to(server: LiveServer) -> Iterator[Any]:
    with contextlib.closing(part("line").Line(server.address, "", drives=True)) as line:
        line.open()
        yield line


@pytest.mark.realtime
def test_random_orders_are_driven_and_the_returned_actions_were_done(server):
    chance = random.Random(1)
    with line_to(server) as line:
        line.begin()
        assert set(line.points) < {str(move) for move in server.driver.moves}
        ticks: list[tuple[int, str]] = []
        server.rig.loop.subscribe(
            lambda tick: ticks.append((tick.frame_id or 0, str(tick.decision.action)))
        )
        points = {**line._declared, "stop": (0.0, 0.0)}

        def since(frame: int, point: tuple[float, float]) -> bool:
            return any(at >= frame and points[did] == point for at, did in ticks[-200:])

        for _ in range(ORDERS):
            asked = asks(chance.uniform(-1.2, 1.2), chance.choice([0.0, 0.5, -0.5, 1.0, None]))
            before = line.state["frame"]
            done = line.drive(asked)
            if line.state["mode"] == "train":
                wait_until(functools.partial(since, before, done), f"{done} after {asked}")
            else:  # a busy machine stopped the robot
                assert done == (0.0, 0.0)
                line.begin()
        refused = server.hub.refused
        assert not refused["bad_field"] and not refused["too_fast"], refused


def test_a_message_that_is_read_late_was_sent_when_the_robot_says():
    sent = part("line").Sent()
    for i in range(20):
        sent.at_s(1000.0 + 100 * i, 500.0 + 0.1 * i)
    assert sent.at_s(3000.0, 504.0) == pytest.approx(502.0), "2 s of waiting in the socket"
    for i in range(36_000):  # for an hour, this clock runs 50 ppm too fast
        now_s, robot_ms = 504.0 + 0.1 * i * 1.00005, 5000.0 + 100 * i
        assert now_s - sent.at_s(robot_ms, now_s) < 0.01


@pytest.mark.realtime
def test_an_order_needs_the_wheel_and_a_fresh_proof_or_is_refused(server, monkeypatch, caplog):
    without_the_wheel_the_line_does_not_begin(server, monkeypatch)
    an_order_waits_for_a_fresh_proof(server, monkeypatch)
    a_refusal_is_reported_once_a_second(server, caplog)


def an_order_waits_for_a_fresh_proof(server: LiveServer, monkeypatch: pytest.MonkeyPatch) -> None:
    with line_to(server) as line:
        line.begin()
        with monkeypatch.context() as held_up:
            held_up.setattr(line, "_take_nonce", lambda *_: None)
            line._proven_s -= 10.0
            before = line._seq
            line.drive(asks(0.0, 0.5))
            assert line._seq - before <= 1, "at most the message in progress was sent"
        # If the robot still finds the proof too old, the order is sent again.
        monkeypatch.setattr(part("line"), "_DONE_WITHIN_S", 30.0)
        for _ in range(20):  # a newer proof may arrive first, or a busy machine stop it
            line.begin()
            line.drive(asks(0.0, 0.0))
            before = server.hub.refused["stale"]
            line._proven_s, line._nonce = time.monotonic(), 1
            is_done = line.drive(asks(-1.0, 0.5)) == (-1.0, 0.5)
            if is_done and server.hub.refused["stale"] > before:
                return
        pytest.fail("the order was never sent again")


def without_the_wheel_the_line_does_not_begin(
    server: LiveServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as hasty, Pilot(server.ws("/ws/drive"), sees=True) as pilot:
        hasty.setattr(part("line"), "_WHEEL_S", 0.3)
        pilot.drive_until(lambda: server.driver.now is Action.FORWARD)
        with (
            line_to(server) as line,
            pytest.raises(ConnectionError, match=f"has the wheel of .*{pilot.hello['client']}"),
        ):
            line.begin()
        assert pilot.state["you_are_pilot"], "the failed attempt did not disturb the pilot"
        pilot.drive_until(lambda: server.driver.now is Action.FORWARD)


def a_refusal_is_reported_once_a_second(
    server: LiveServer, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.clear()
    with line_to(server) as line:
        line.begin()
        # this proof was fresh when the line opened, but is too old now
        line.points["spin_left"] = (-1.0, 0.0)
        assert line.drive(asks(-1.0, 0.0)) == (0.0, 0.0)
        for _ in range(20):
            line._send(type="drive", held="no_move")
        line._comes(lambda: server.hub.refused["bad_field"] == 21, 30.0)
        assert "spin_left" not in line.points
        server.rig.loop.latch_emergency()
        line._comes(lambda: line.state["emergency"], 30.0)
        assert line.drive(asks(0.0, 0.5)) == (0.0, 0.0)
        with pytest.raises(ConnectionError, match="emergency stop is on"):
            line.begin()
    said = [record for record in caplog.records if "refuses" in record.message]
    assert 1 <= len(said) <= 3 and "held" in said[0].message
