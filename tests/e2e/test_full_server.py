"""The settings carry a simulated robot to another world, in CI in every language."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import httpx
import pytest

from robot.simulator.world import load_world, world_names
from robot.types import Mode
from tests.kit.sizes import few
from tests.kit.wait import wait_until

from .test_holds_still import messages
from .world import PHONE, new_context, open_page, running_world, show

pytestmark = [pytest.mark.browser, pytest.mark.slow]


def test_another_place_is_chosen_on_the_page(chromium: Any, tmp_path: Path) -> None:
    own = tmp_path / "yard.toml"
    own.write_bytes(
        (Path(load_world.__code__.co_filename).parent / "worlds/push.toml").read_bytes()
    )
    with running_world(tmp_path / "data", world=str(own)) as world:
        simulation = world.rig.driver.simulation  # type: ignore[attr-defined]
        url = f"{world.address}/api/world"
        for language in few(("en", "es", "zh"), 1):
            words = messages(language)
            context = new_context(chromium, PHONE, locale=language)
            page = open_page(context, world.address)
            for place in few([*world_names(), "yard"], 3):
                show(page, "settings")
                choice = page.get_by_label(words["settings.world"], exact=True)
                choice.select_option(words.get(f"world.{place}", place))
                wait_until(lambda place=place: simulation.world.name == place, f"it is in {place}")
                shown = choice.input_value
                wait_until(lambda shown=shown, place=place: shown() == place, "it is chosen")
                drawn = len(simulation.world.obstacles)
                page.wait_for_function(
                    "n => document.querySelectorAll('settings-screen .thing').length === n",
                    arg=drawn,
                )
                start = simulation.world.start
                assert abs(world.pose.x_m - start.x_m) <= simulation.world.start_spread_m + 0.01
                # The map on the drive screen shows the new place.
                show(page, "drive")
                frame = world.rig.loop.state.frame_id or 0
                wait_until(
                    lambda frame=frame: (world.rig.loop.state.frame_id or 0) > frame + 1, "it sees"
                )
                page.wait_for_function(
                    "n => document.querySelectorAll('drive-map .thing').length === n", arg=drawn
                )
            context.close()
        assert httpx.get(url).json()["worlds"] == sorted([*world_names(), "yard"])
        for strange in ("nowhere", str(own), "../box", ""):
            answer = httpx.put(url, json={"name": strange})
            assert (answer.status_code, "choose one of: box" in answer.json()["detail"]) == (
                409,
                True,
            )
        world.rig.loop.set_mode(Mode.TRAIN, proven_s=world.rig.clock.now_s()).result(60)
        if world.mode is not Mode.STOPPED:
            answer = httpx.put(url, json={"name": "box"})
            assert (answer.status_code, "stop the robot" in answer.json()["detail"]) == (409, True)
        assert httpx.get(url).json()["world"]["name"] == "yard"
