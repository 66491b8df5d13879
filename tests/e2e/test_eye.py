"""A phone becomes the robot's eye in Chromium, whose fake camera plays footage."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from robot.policy.image import to_rgb
from tests.e2e.eye import Watch, phone_with_film, robot_with_an_eye, write_film
from tests.kit.wait import wait_until

pytestmark = pytest.mark.browser


def test_a_phone_is_the_eye_and_its_stop_is_obeyed(tmp_path: Path) -> None:
    film = tmp_path / "film.y4m"
    colours = np.random.default_rng(1).integers(60, 255, (10, 1, 1, 3), np.uint8)
    write_film(film, np.broadcast_to(colours, (10, 120, 160, 3)))
    with robot_with_an_eye() as (rig, address), phone_with_film(film) as context:
        assert "No phone" in (rig.camera.fault or "No phone")
        page = context.new_page()
        complaints: list[str] = []
        page.on("console", lambda m: complaints.append(m.text) if m.type == "error" else None)
        watch = Watch(rig)
        page.goto(address + "/eye")
        watch.wait_for(12)
        frame = watch.frames[-1]
        assert (frame.width, frame.height) == (320, 240) and rig.camera.fault is None
        shown = to_rgb(frame).reshape(-1, 3)
        assert np.ptp(shown.astype(int), axis=0).max() < 40, "one colour, as the film has it"
        assert min(watch.ages_ms) >= 0
        assert page.locator("#said").inner_text()
        page.locator("#stop").tap()
        page.locator("#said[data-level=bad]").wait_for()
        assert rig.loop.state.emergency

        def is_released() -> bool:
            # The press was also sent by a request, which may arrive after a release.
            rig.loop.release_emergency().result(60)
            return bool(page.locator("#said[data-level=good]").is_visible())

        wait_until(is_released, "the page says that the stop is over")
        page.keyboard.press("Space")
        page.locator("#said[data-level=bad]").wait_for()
        assert rig.loop.state.emergency
        box = page.locator("#stop").bounding_box()
        assert box is not None and box["height"] >= 96 and box["width"] >= 300
        page.close()
        seen = len(watch.frames)
        for _ in range(200):
            if rig.camera.fault:
                break
            rig.clock.sleep(0.05)
        assert re.search(r"gone", rig.camera.fault or "")
        assert len(watch.frames) >= seen
        assert complaints == []


def test_a_covered_lens_is_told(tmp_path: Path) -> None:
    film = tmp_path / "film.y4m"
    nights = np.random.default_rng(1).integers(0, 12, (10, 120, 160, 3), np.uint8)
    write_film(film, nights)
    with robot_with_an_eye() as (rig, address), phone_with_film(film) as context:
        page = context.new_page()
        page.goto(address + "/eye")
        page.locator("#said", has_text="covered").wait_for(timeout=40_000)
        assert "covered" in (rig.camera.fault or "")
        assert rig.camera.latest() is None
