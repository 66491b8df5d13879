"""The screens that show what the learner has learned, and change it, work one after the other."""

from __future__ import annotations

from typing import Any

import httpx
import pytest

from robot.types import Action, Mode, Prediction
from tests.kit.wait import wait_until

from .hand import Fingers, choose, hold_until
from .world import World, show


@pytest.fixture
def frame_rate_hz() -> float:
    """A high rate, so that the first teaching takes little time."""
    return 10.0


SHOWN = """async () => {
  const shown = {};
  for (const { src } of document.querySelectorAll('.card img')) {
    const bytes = await (await fetch(src, { cache: 'force-cache' })).arrayBuffer();
    shown[src.match(/(\\d+)\\.png/)[1]] = [...new Uint8Array(bytes)];
  }
  return shown;
}"""
"""The bytes of each image in the gallery, from the browser's cache."""


def teach(page: Any, world: World, *moves: str, frames_each: int = 15) -> None:
    """Hold each of the moves for a while, so that the learner has images of each move."""
    choose(page, world, Mode.TRAIN)
    fingers = Fingers(page)
    for move in moves:
        wanted = world.lessons + frames_each
        hold_until(world, fingers, move, lambda n=wanted: world.lessons >= n)
        fingers.lift()
    choose(page, world, Mode.STOPPED)


def params_of(world: World) -> dict[str, Any]:
    def request() -> dict[str, Any]:
        return dict(world.rig.loop.history.policy.get_state().params)

    return world.rig.loop.submit(request).result(60)


def the_images_are_those_of_the_model_in_use(page: Any, world: World) -> None:
    """Images of another model have the same numbers, but the browser must not show cached ones."""
    show(page, "gallery")
    page.locator(".card").first.wait_for()
    shown = page.evaluate(SHOWN)
    assert shown
    for node, image in shown.items():
        assert bytes(image) == httpx.get(f"{world.address}/api/gallery/{node}.png").content


def test_the_page_shows_changes_and_undoes_what_was_taught(phone: Any, world: World) -> None:
    missing: list[str] = []
    phone.on("response", lambda r: missing.append(r.url) if r.status >= 400 else None)
    the_robot_drives_at_the_chosen_speed(phone, world)
    teach(phone, world, "forward", "left")
    the_pilots_statements_count_until_they_are_withdrawn(phone, world)
    a_relabelled_image_changes_the_prediction(phone, world)
    the_images_are_those_of_the_model_in_use(phone, world)
    assert missing == [], "the page requested addresses that do not exist"
    a_model_is_renamed_and_copied_and_a_new_one_begun(phone, world)
    show(phone, "drive")
    teach(phone, world, "left", frames_each=8)
    the_images_are_those_of_the_model_in_use(phone, world)
    undo_removes_the_shown_examples(phone, world)
    an_earlier_and_a_deleted_model_are_restored(phone, world)
    another_place_is_chosen_and_drawn(phone, world)


def the_robot_drives_at_the_chosen_speed(phone: Any, world: World) -> None:
    show(phone, "settings")
    phone.get_by_role("slider", name="Speed").fill("50")
    wait_until(lambda: world.rig.loop.speed_share == 0.5, "the speed is set")
    show(phone, "drive")
    choose(phone, world, Mode.TRAIN)
    fingers = Fingers(phone)
    hold_until(world, fingers, "left", lambda: world.action is Action.LEFT)
    assert world.rig.loop.state.decision.speed_scale == 0.5
    fingers.lift()


def the_pilots_statements_count_until_they_are_withdrawn(phone: Any, world: World) -> None:
    def outdated_before() -> int:
        return int(params_of(world)["learner"]["outdated_before"])

    show(phone, "teaching")
    phone.get_by_role("button", name="I do it differently now").tap()
    wait_until(lambda: outdated_before() > 0, "earlier examples are outdated")
    phone.locator("toast-bar").get_by_role("button", name="Undo").tap()
    wait_until(lambda: outdated_before() == 0, "earlier examples count again")
    word = phone.get_by_role("checkbox", name="Left and right are alike here")
    word.check()
    wait_until(lambda: params_of(world)["alike"], "left and right are alike")
    word.uncheck()
    wait_until(lambda: not params_of(world)["alike"], "left and right differ again")


def a_relabelled_image_changes_the_prediction(phone: Any, world: World) -> None:
    def prediction() -> Prediction:
        now = world.rig.loop.state.prediction
        assert now is not None
        return now

    def votes_for_right() -> float:
        return prediction().probabilities.get(Action.RIGHT, 0.0)

    wait_until(lambda: prediction().action is Action.LEFT, "the robot proposes left")
    show(phone, "gallery")
    phone.locator(".lit .card").tap()
    phone.locator(".detail [data-move=right]").tap()
    wait_until(lambda: votes_for_right() > 0.1, "the view's nearest image speaks for the new label")
    phone.locator("toast-bar button").tap()
    wait_until(lambda: votes_for_right() < 0.05, "the relabelling is undone")


def undo_removes_the_shown_examples(phone: Any, world: World) -> None:
    lessons = world.lessons
    show(phone, "undo")
    phone.locator("undo-screen .strip [role=listitem]").first.wait_for()
    assert "Left" in phone.locator("undo-screen [role=status]").inner_text()
    phone.locator("undo-screen .wide").tap()
    phone.locator("toast-bar").wait_for()
    wait_until(lambda: world.lessons < lessons, "the newest examples are gone")


def a_model_is_renamed_and_copied_and_a_new_one_begun(phone: Any, world: World) -> None:
    show(phone, "home")
    phone.get_by_role("button", name="More about Rover").tap()
    phone.get_by_label("Name").fill("Kitchen")
    phone.get_by_label("Place").fill("at home")
    phone.get_by_role("button", name="Save").tap()
    phone.locator(".model small", has_text="at home").wait_for()
    phone.get_by_role("button", name="Copy").tap()
    phone.locator(".model >> nth=1").wait_for()
    phone.get_by_role("button", name="Start over").tap()
    phone.locator("toast-bar", has_text="knows nothing").wait_for()
    wait_until(lambda: world.lessons == 0, "the robot has no examples")


def an_earlier_and_a_deleted_model_are_restored(phone: Any, world: World) -> None:
    lessons = world.lessons
    show(phone, "home")
    phone.get_by_role("button", name="More about Kitchen", exact=True).tap()
    use = phone.get_by_role("button", name="Use this one")
    use.tap()
    wait_until(lambda: world.lessons > lessons, "the earlier model is back")
    use.wait_for(state="detached")  # the list is redrawn, so a tap on the old list would be lost
    phone.get_by_role("button", name="Delete").first.tap()
    phone.locator("toast-bar button").tap()
    phone.locator(".model h3", has_text="Kitchen").first.wait_for()


def another_place_is_chosen_and_drawn(phone: Any, world: World) -> None:
    simulation = world.rig.driver.simulation
    show(phone, "settings")
    phone.get_by_label("Place", exact=True).select_option("box")
    wait_until(lambda: simulation.world.name == "box", "the robot is in the box")
    for screen, drawn in (("settings", "settings-screen"), ("drive", "drive-map")):
        show(phone, screen)
        phone.wait_for_function(
            "([map, n]) => document.querySelectorAll(`${map} .thing`).length === n",
            arg=[drawn, len(simulation.world.obstacles)],
        )
    url = f"{world.address}/api/world"
    unknown = httpx.put(url, json={"name": "../box"})
    assert unknown.status_code == 409 and "choose one of: box" in unknown.json()["detail"]
    choose(phone, world, Mode.TRAIN)
    driven = httpx.put(url, json={"name": "office"})
    assert world.mode is Mode.STOPPED or "stop the robot" in driven.json()["detail"]
    phone.locator("drive-pad .stop").tap()
