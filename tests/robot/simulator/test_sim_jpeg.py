"""The simulated camera's JPEGs are as small as a webcam's, and its renderer leaks no memory."""

from __future__ import annotations

import math
import random
import threading
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from robot.control.loop import ControlLoop
from robot.driver import Pose
from robot.policy.image import to_rgb
from robot.policy.registry import make_policy
from robot.recordings.config import RecorderConfig
from robot.recordings.recorder import Recorder
from robot.simulator.camera import SimCamera, SimCameraOptions
from robot.simulator.driver import SimDriver, SimOptions
from robot.simulator.renderer import Renderer
from robot.simulator.simulation import Simulation
from robot.simulator.world import load_world, world_names
from robot.store.models.model import encode_model, take_model
from robot.testing import VirtualClock
from robot.types import Action, Encoding, Mode, PilotCommand
from tests.kit.sizes import seeds

core = pytest.importorskip("panda3d.core", reason="the simulator's renderer is not installed")
pytest.importorskip("mcap")
RATE_HZ = 30
MOVES = (Action.FORWARD, Action.LEFT, Action.FORWARD, Action.RIGHT)


def watched(clock: VirtualClock | None = None, **options: Any) -> tuple[SimDriver, SimCamera]:
    driver = SimDriver(SimOptions(**options))
    driver.connect()
    return driver, SimCamera(driver, SimCameraOptions(), clock or VirtualClock())


def test_a_minute_of_driving_costs_at_most_eight_megabytes(tmp_path: Path) -> None:
    """Record six seconds, in the simulation's own time, through the real loop and recorder."""
    clock = VirtualClock(1.0)
    driver, camera = watched(clock, world="office")
    loop = ControlLoop(driver, camera, make_policy("default-32"), clock)
    recorder = Recorder(loop, tmp_path, config=RecorderConfig(spare_bytes=0))
    recorder.start()
    seconds = 6
    camera._take()
    loop.tick(clock.now_s())
    loop.set_mode(Mode.TRAIN)
    loop.tick(clock.now_s())
    for step in range(seconds * RATE_HZ):
        clock.advance(1 / RATE_HZ)
        driver.advance(1 / RATE_HZ)
        frame = camera._take()
        assert frame.encoding is Encoding.JPEG
        held = MOVES[step // RATE_HZ % len(MOVES)]
        now_s = clock.now_s()
        loop.command(PilotCommand(held=held, frame_id=frame.frame_id, seq=step, received_s=now_s))
        loop.tick(now_s)
    # The final model's size does not depend on the drive's length.
    model = take_model(loop.history.policy, Counter(), saved_at_s=0.0)
    before = len(encode_model(model, is_packed=True))
    recorder.finish()
    recorder.stop()
    [path] = tmp_path.glob("*.mcap")
    driver.disconnect()
    assert sum(loop.state.taught.values()) > 0.9 * seconds * RATE_HZ
    a_minute = (path.stat().st_size - before) * 60 / seconds + before
    assert a_minute <= 8e6


def test_experiments_get_uncompressed_pixels() -> None:
    driver, camera = watched()
    raw, jpeg = camera.capture(), camera._take()
    assert raw.encoding is Encoding.RGB and len(raw.data) == 160 * 120 * 3
    assert abs(to_rgb(raw).astype(int) - to_rgb(jpeg)).mean() < 6
    assert len(jpeg.data) < len(raw.data) / 8
    assert jpeg.data[:2] == b"\xff\xd8"
    driver.disconnect()


@pytest.mark.parametrize("seed", seeds(1, 3))
def test_larger_pictures_for_viewers_do_not_change_what_is_learned_and_recorded(seed: int) -> None:
    """However many viewers watch, the robot's own frames stay the same."""
    chance = random.Random(seed)
    world = chance.choice(world_names())
    plan = [(chance.choice(MOVES), chance.random() < 0.5) for _ in range(60)]

    def frames(is_looked_at: bool) -> list[bytes]:
        (driver, camera), taken, n_large = watched(world=world, seed=seed), [], 0
        for move, looks in plan:
            driver.send_action(move)
            driver.advance(1 / RATE_HZ)
            frame = camera._take()
            taken.append(frame.data)
            if is_looked_at and looks:
                large = camera.for_the_eye(frame)
                assert (large.frame_id, large.captured_s) == (frame.frame_id, frame.captured_s)
                n_large += large is not frame
                if large is not frame:
                    assert (large.width, large.height) == (320, 240)
                    half = to_rgb(large).reshape(120, 2, 160, 2, 3).mean(axis=(1, 3))
                    assert abs(half - to_rgb(frame)).mean() < 8, "both frames show the same"
        if is_looked_at:
            assert n_large >= sum(looks for _, looks in plan) - 1, "all large frames but the first"
            for _ in range(40):
                last = camera._take()
            assert camera.for_the_eye(last) is last, "no viewer is left"
        driver.simulation.close()
        return taken

    assert frames(True) == frames(False)


@pytest.mark.parametrize(
    ("takes_s", "late_s", "rate_hz"),
    [
        (0.005, 0.0, 30.0),
        (0.03, 0.0, 16.7),
        (0.005, 0.015, 12.5),
        (0.08, 0.1, 5.0),
    ],
)
def test_a_busy_computer_makes_fewer_pictures(
    monkeypatch: pytest.MonkeyPatch, takes_s: float, late_s: float, rate_hz: float
) -> None:
    clock = VirtualClock()
    driver, camera = watched(clock)
    render, wait = driver.simulation.render, clock.wait

    def wait_too_long(event: threading.Event, timeout_s: float | None) -> bool:
        is_set = wait(event, timeout_s)
        if event is camera._stirred:
            clock.sleep(late_s)
        return is_set

    def take_long() -> object:
        clock.sleep(takes_s)
        return render()

    monkeypatch.setattr(driver.simulation, "render", take_long)
    monkeypatch.setattr(clock, "wait", wait_too_long)
    camera.start()
    clock.sleep(4.0)
    before = camera._last_frame_id
    clock.sleep(4.0)
    camera.stop()
    assert (camera._last_frame_id - before) / 4.0 == pytest.approx(rate_hz, rel=0.1)
    driver.disconnect()


# The renderer ----------------------------------------------------------------------------------


def pose(k: int) -> Pose:
    return Pose(x_m=0.5 + 0.2 * math.sin(0.11 * k), y_m=0.5, heading_rad=0.23 * k)


def pictures(seed: int, count: int = 60) -> list[bytes]:
    """Render from many poses, and every tenth time also at twice the size."""
    world = load_world("push")
    renderer, found = Renderer(world, seed), []
    for k in range(count):
        found.append(renderer.render(pose(k), world.obstacles).tobytes())
        if k % 10 == 0:
            found.append(renderer.render_large().tobytes())
    renderer.close()
    return found


def test_a_picture_leaves_no_state_behind() -> None:
    """In an earlier version, each new pose leaked two to four transform states, 2.6 kB."""
    world = load_world("push")
    renderer = Renderer(world)

    def states_after(first: int, count: int) -> int:
        for k in range(first, first + count):
            renderer.render(pose(k), world.obstacles)
        return int(core.TransformState.getNumStates() + core.RenderState.getNumStates())

    before = states_after(0, 20)
    assert states_after(20, 200) - before < 10
    renderer.close()


def test_a_closed_world_is_freed_when_the_next_is_drawn() -> None:
    """In an earlier version, each world that was opened and closed leaked its floor, 1 MB."""
    first, second = Renderer(load_world("box")), Renderer(load_world("box"))
    first.render(pose(0))
    first.render_large()
    floor = first._root.findTexture("floor")
    assert floor.getRefCount() > 1
    first.close()
    first.close()
    second.render(pose(0))
    second.render_large()
    assert floor.getRefCount() == 1, "the closed renderer still refers to its floor"
    second.close()


def test_each_thread_draws_the_same_as_without_the_others_and_each_seed_differs() -> None:
    alone = [pictures(seed) for seed in range(4)]
    assert alone[0] != alone[1]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(pictures, range(4))) == alone


def test_the_same_seed_gives_the_same_numbers_and_pictures() -> None:
    def run(seed: int) -> tuple[object, bytes]:
        simulation = Simulation(load_world("office"), seed)
        simulation.action = Action.FORWARD
        for _ in range(30):
            simulation.step(0.1)
            picture = simulation.render()
        sensed = simulation.sensors.read()
        simulation.close()
        return (sensed.pose, sensed.distance_m), picture.tobytes()

    assert run(seed=4) == run(seed=4) != run(seed=5)
