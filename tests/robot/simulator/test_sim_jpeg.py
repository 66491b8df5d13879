"""The simulated camera in real time: JPEG like a webcam's, small on the disk."""

from __future__ import annotations

import random
import threading
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from robot.policy.image import to_rgb
from robot.recordings.recorder import Recorder
from robot.simulator.camera import SimCamera, SimCameraOptions
from robot.testing import VirtualClock
from robot.types import Action, Encoding

pytest.importorskip("panda3d")
pytest.importorskip("mcap")

from robot.control.loop import ControlLoop
from robot.policy.registry import make_policy
from robot.recordings.config import RecorderConfig
from robot.simulator.driver import SimDriver, SimOptions
from robot.simulator.world import world_names
from robot.store.models.model import encode_model, take_model
from robot.types import Mode, PilotCommand

RATE_HZ = 30
MOVES = (Action.FORWARD, Action.LEFT, Action.FORWARD, Action.RIGHT)


def watched(clock: VirtualClock | None = None, **options: Any) -> tuple[SimDriver, SimCamera]:
    driver = SimDriver(SimOptions(**options))
    driver.connect()
    return driver, SimCamera(driver, SimCameraOptions(), clock or VirtualClock())


@pytest.mark.parametrize("world", ["box", "office", "corridor"])
def test_a_minute_of_driving_costs_at_most_eight_megabytes(tmp_path: Path, world: str) -> None:
    """Record ten seconds, in the simulation's own time, through the real loop and recorder."""
    clock = VirtualClock(1.0)
    driver, camera = watched(clock, world=world)
    loop = ControlLoop(driver, camera, make_policy("default-32"), clock)
    recorder = Recorder(loop, tmp_path, config=RecorderConfig(spare_bytes=0))
    recorder.start()
    seconds = 10
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
    print(f"{world}: {a_minute / 1e6:.2f} MB a minute")
    assert a_minute <= 8e6


def test_experiments_get_uncompressed_pixels() -> None:
    driver, camera = watched()
    raw, jpeg = camera.capture(), camera._take()
    assert raw.encoding is Encoding.RGB and len(raw.data) == 160 * 120 * 3
    assert abs(to_rgb(raw).astype(int) - to_rgb(jpeg)).mean() < 6
    assert len(jpeg.data) < len(raw.data) / 8
    assert jpeg.data[:2] == b"\xff\xd8"
    driver.disconnect()


@pytest.mark.parametrize("seed", range(4))
def test_larger_pictures_for_viewers_do_not_change_what_is_learned_and_recorded(seed: int) -> None:
    """For any number of viewers, the frames are those of an unwatched robot."""
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
                    assert abs(half - to_rgb(frame)).mean() < 8, "it shows the same"
        if is_looked_at:
            assert n_large >= sum(looks for _, looks in plan) - 1, "all but the first"
        driver.simulation.close()
        return taken

    assert frames(True) == frames(False)


def test_without_viewers_no_larger_pictures_are_made() -> None:
    driver, camera = watched()
    camera.for_the_eye(camera._take())
    large = [camera.for_the_eye(camera._take()).width for _ in range(3)]
    assert large == [320, 320, 320]
    for _ in range(40):
        last = camera._take()
    assert camera.for_the_eye(last) is last
    driver.simulation.close()


@pytest.mark.parametrize(
    ("takes_s", "late_s", "rate_hz"),
    [
        (0.005, 0.0, 30.0),
        (0.03, 0.0, 16.7),
        (0.08, 0.0, 10.0),
        (0.005, 0.008, 30.0),
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
