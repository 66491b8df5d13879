"""The settings carry a simulated robot to another world."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import httpx
import pytest

from robot.simulator.world import load_world
from robot.types import Mode
from tests.kit.wait import wait_until

from .world import PHONE, new_context, open_page, running_world, show

pytestmark = [pytest.mark.browser, pytest.mark.slow]


def test_another_place_is_chosen_on_the_page(chromium: Any, tmp_path: Path) -> None:
    own = tmp_path / "yard.toml"
    kept = Path(load_world.__code__.co_filename).parent / "worlds/push.toml"
    own.write_bytes(kept.read_bytes())
    with running_world(tmp_path / "data", world=str(own)) as world:
        simulation = world.rig.driver.simulation  # type: ignore[attr-defined]
        context = new_context(chromium, PHONE, locale="en")
        page = open_page(context, world.address)
        choice = page.get_by_label("Place", exact=True)
        for place in ("box", "office", "yard"):
            show(page, "settings")
            choice.select_option(place)
            wait_until(lambda place=place: simulation.world.name == place, f"it is in {place}")
            wait_until(lambda place=place: choice.input_value() == place, "it is chosen")
            for screen in ("settings-screen", "drive-map"):
                if screen == "drive-map":
                    show(page, "drive")
                page.wait_for_function(
                    "([map, n]) => document.querySelectorAll(`${map} .thing`).length === n",
                    arg=[screen, len(simulation.world.obstacles)],
                )
        context.close()

        def refusal(name: str) -> str:
            answer = httpx.put(f"{world.address}/api/world", json={"name": name})
            assert answer.status_code == 409, name
            return str(answer.json()["detail"])

        for strange in ("nowhere", str(own), "../box", ""):
            assert "choose one of: box" in refusal(strange)
        world.rig.loop.set_mode(Mode.TRAIN, proven_s=world.rig.clock.now_s()).result(60)
        if world.mode is not Mode.STOPPED:
            assert "stop the robot" in refusal("box")
        assert simulation.world.name == "yard"
