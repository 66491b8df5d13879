"""A phone becomes the robot's eye in Chromium, whose fake camera plays a film.

tests/web/eye-page.test.mjs tests in Node when the eye's page sends STOP, and what its keys do.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from robot.bodies.phone.camera import PhoneCamera, PhoneOptions
from robot.clock import RealClock
from robot.devices.rig import Rig
from robot.exchange.replay_driver import ReplayDriver
from robot.policy.image import to_rgb
from robot.policy.registry import make_policy
from robot.types import Frame
from server.app import create_app
from server.config import Config
from server.lab.served import served
from server.services import Services
from tests.kit.wait import wait_until
from tests.server.live_robot import WEB

from .world import PHONE, running_chromium

pytestmark = pytest.mark.browser


def write_film(path: Path) -> None:
    """Write 5 s of bright pictures and 3 s of dark ones; the fake camera plays them in a loop."""
    draw = np.random.default_rng(1).integers
    with path.open("wb") as file:
        file.write(b"YUV4MPEG2 W640 H480 F10:1 Ip C420jpeg\n")
        for number in range(80):
            if number < 50:
                picture = np.full((480, 640, 3), draw(60, 255, 3), np.uint8)
            else:
                dark = draw(0, 12, (120, 160, 3), np.uint8)
                picture = cv2.resize(dark, (640, 480), interpolation=cv2.INTER_NEAREST)
            file.write(b"FRAME\n" + cv2.cvtColor(picture, cv2.COLOR_RGB2YUV_I420).tobytes())


@contextlib.contextmanager
def phone_with_film(film: Path) -> Iterator[Any]:
    """Start a Chromium whose camera shows the film, without asking for permission."""
    flags = (
        "--use-fake-ui-for-media-stream",
        "--use-fake-device-for-media-stream",
        f"--use-file-for-fake-video-capture={film}",
        "--autoplay-policy=no-user-gesture-required",
    )
    with running_chromium(*flags) as browser:
        context = browser.new_context(viewport=PHONE, permissions=["camera"], has_touch=True)
        yield context
        context.close()


def test_a_phone_as_the_eye_reports_a_covered_lens_and_its_stop_is_obeyed(tmp_path: Path) -> None:
    film = tmp_path / "film.y4m"
    write_film(film)
    clock, config = RealClock(), Config(port=0, web=WEB)
    camera = PhoneCamera(PhoneOptions(), clock)
    rig = Rig(ReplayDriver(), camera, make_policy("default-32"), clock)
    services = Services(config, rig)
    with rig, served(create_app(services), config) as address, phone_with_film(film) as context:
        page = context.new_page()
        complaints: list[str] = []
        page.on("console", lambda m: complaints.append(m.text) if m.type == "error" else None)
        frames: list[tuple[Frame, float]] = []

        def note(tick: Any) -> None:
            if tick.frame is not None:
                frames.append((tick.frame, rig.clock.now_s()))

        rig.loop.need_picture_every(0.0)  # while the robot stands, it would skip pictures
        rig.loop.subscribe(note)
        page.goto(address + "/eye")
        wait_until(lambda: len(frames) >= 12, "the robot gets the phone's pictures")
        frame, _ = frames[-1]
        assert (frame.width, frame.height) == (320, 240)
        assert np.ptp(to_rgb(frame).reshape(-1, 3).astype(int), axis=0).max() < 40
        assert all(frame.captured_s <= at_s for frame, at_s in frames)
        page.locator("#said", has_text="covered").wait_for()
        wait_until(lambda: "covered" in (rig.camera.fault or ""), "the robot is told, too")

        page.locator("#stop").tap()
        wait_until(lambda: rig.loop.state.emergency, "the phone's STOP")
        page.locator("#said[data-level=bad]").wait_for()

        def is_released() -> bool:
            # The press was also sent by a request, which may arrive after the release.
            rig.loop.release_emergency().result(60)
            return bool(page.locator("#said[data-level=good]").is_visible())

        wait_until(is_released, "the page says that the stop is over")
        page.close()
        wait_until(
            lambda: "disconnected" in (rig.camera.fault or ""),
            "the robot tells that its eye is gone",
        )
        assert complaints == []
