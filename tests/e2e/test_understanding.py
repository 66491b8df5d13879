"""The page shows the learner truthfully: gallery, undo, trial, models, settings."""

from __future__ import annotations

import csv
import zipfile
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from robot.study.session import SessionStep
from robot.types import Action, Mode, Prediction
from server.study.extension import StudyExtension
from tests.kit.wait import wait_until

from .hand import Fingers, choose, drive_on, hold_until, teach
from .world import World, show

pytestmark = [pytest.mark.browser, pytest.mark.slow]


@pytest.fixture
def frame_rate_hz() -> float:
    """A high rate, so that the first teaching takes little time."""
    return 15.0


def teach_both_moves(page: Any, world: World, frames_each: int = 25) -> None:
    """Forward first, then left, so that the learner has images of both."""
    choose(page, world, Mode.TRAIN)
    fingers = Fingers(page)
    for move in ("forward", "left"):
        wanted = world.lessons + frames_each
        hold_until(world, fingers, move, lambda n=wanted: world.lessons >= n)
        fingers.lift()
    choose(page, world, Mode.STOPPED)


def state_of(world: World) -> Any:
    return world.rig.loop.submit(lambda: world.rig.loop.history.policy.get_state()).result(60)


def test_undo_restores_the_exact_learner_from_before(phone: Any, world: World) -> None:
    teach_both_moves(phone, world)
    before, lessons = state_of(world), world.lessons
    choose(phone, world, Mode.TRAIN)
    fingers = Fingers(phone)
    seconds_before = _teaching_s(world)

    def is_enough() -> bool:
        # A busy computer learns few examples in the displayed seconds.
        wrong = world.lessons - lessons
        return wrong >= 30 or (wrong > 0 and _teaching_s(world) > seconds_before + 2)

    hold_until(world, fingers, "right", is_enough)
    fingers.lift()
    choose(phone, world, Mode.STOPPED)
    wrong = world.lessons - lessons
    seconds = world.rig.loop.submit(lambda: _seconds_of_last(world, wrong)).result(60)
    assert seconds < 5, "the shortest undo takes more than was wrong"

    phone.goto(world.address + "/#undo")
    phone.locator("undo-screen .strip [role=listitem]").first.wait_for()
    shown = phone.locator("undo-screen [role=status]").inner_text()
    assert f"Right {wrong}" in shown
    answer = httpx.post(f"{world.address}/api/teaching/undo", json={"seconds": seconds})
    assert answer.json() == {"undone": wrong, "kept": True}
    after = state_of(world)
    assert world.rig.loop.submit(lambda: world.rig.loop.history.n_examples).result(60) == lessons
    for name, array in before.arrays.items():
        np.testing.assert_array_equal(after.arrays[name], array, err_msg=name)

    phone.locator("undo-screen .wide").tap()
    phone.locator("toast-bar").wait_for()
    wait_until(lambda: world.lessons < lessons, "the page's own button undoes as well")


def test_a_pilot_says_that_he_does_it_differently_and_takes_that_back(
    phone: Any, world: World
) -> None:
    def outdated_before() -> int:
        return int(state_of(world).params["learner"]["outdated_before"])

    teach_both_moves(phone, world)
    phone.goto(world.address + "/#teaching")
    phone.get_by_role("button", name="I do it differently now").tap()
    wait_until(lambda: outdated_before() > 0, "what was taught before is outdated")
    phone.locator("toast-bar").get_by_role("button", name="Undo").tap()
    wait_until(lambda: outdated_before() == 0, "it counts again")


def test_a_pilot_says_that_left_and_right_are_alike_and_no_longer(phone: Any, world: World) -> None:
    def alike() -> bool:
        return bool(state_of(world).params["alike"])

    teach_both_moves(phone, world)
    phone.goto(world.address + "/#teaching")
    word = phone.get_by_role("checkbox", name="Left and right are alike here")
    word.check()
    wait_until(alike, "it counts in the mirror, too")
    word.uncheck()
    wait_until(lambda: not alike(), "it no longer does")


def _teaching_s(world: World) -> float:
    return world.rig.loop.submit(lambda: world.rig.loop.history.teaching_s).result(60)


def _seconds_of_last(world: World, lessons: int) -> float:
    """The seconds of training that the last this many examples cover."""
    seconds = 0.05
    while len(world.rig.loop.history.last_examples(seconds)) < lessons:
        seconds += 0.01
    return seconds


def test_a_relabelled_image_changes_what_the_robot_would_do_there(phone: Any, world: World) -> None:
    teach_both_moves(phone, world)

    def prediction() -> Prediction:
        now = world.rig.loop.state.prediction
        assert now is not None
        return now

    wait_until(lambda: prediction().action is Action.LEFT, "it would turn left here")
    phone.goto(world.address + "/#gallery")
    phone.locator(".lit .card").tap()
    phone.locator(".detail [data-move=right]").tap()
    phone.locator("toast-bar").wait_for()
    spoken_for = [{move for move, n in i["votes"].items() if n} for i in _gallery(world)]
    assert spoken_for.count({"right"}) == 1

    def votes_for_right() -> float:
        return prediction().probabilities.get(Action.RIGHT, 0.0)

    wait_until(lambda: votes_for_right() > 0.1, "the view's nearest image speaks for the new label")
    phone.locator("toast-bar button").tap()
    wait_until(lambda: votes_for_right() < 0.05, "undone")


def _gallery(world: World) -> list[dict[str, Any]]:
    images: list[dict[str, Any]] = httpx.get(world.address + "/api/gallery").json()["images"]
    return images


@pytest.mark.parametrize("world", ["box"], indirect=True)
def test_trial_1_from_start_to_result(phone: Any, world: World, tmp_path: Path) -> None:
    phone.goto(world.address + "/#study")
    phone.get_by_role("button", name="Begin the trial").tap()
    phone.get_by_role("button", name="Begin", exact=True).tap()
    phone.locator(".notice", has_text="tap “Teach”").wait_for()
    assert set(world.rig.loop.state.moves) == {Action.FORWARD, Action.LEFT}

    choose(phone, world, Mode.TRAIN)
    conductor = world.services.extension(StudyExtension).conductor
    assert conductor is not None
    session = conductor.session
    assert session is not None
    fingers = Fingers(phone)
    teach(world, fingers, 60)
    session.pace = 110.0  # only now, so that on any machine enough was taught before the end
    teach(world, fingers, 10_000, until=lambda: session.phase_index > 0)
    wait_until(lambda: world.mode is Mode.STOPPED, "the phase is over, the robot stands")
    phone.locator(".notice", has_text="correct the robot").wait_for()
    assert phone.locator("teach-panel strong").text_content() == "–", "no figure while it counts"
    drive_on(phone, world, until=lambda: session.phase_index > 1)
    session.pace = 1.0
    phone.locator(".notice", has_text="hands off").wait_for()
    drive_on(phone, world, until=lambda: session.done_s >= 2.0)
    phone.get_by_text("Part 1 of 1: hands off").first.wait_for()
    session.pace = 110.0
    drive_on(phone, world, until=lambda: session.step is SessionStep.QUESTIONS)

    phone.locator(".notice button", has_text="Answer").tap()
    phone.get_by_role("radio", name="6").check()
    phone.get_by_role("button", name="Send the answers").tap()
    phone.locator(".profiles .curve.robot").first.wait_for(state="attached")
    assert phone.locator(".profiles figure").count() == 2
    drawn = phone.locator(".profiles .curve.pilot").first.get_attribute("points")
    assert len(drawn.split()) == 101
    for who in ("pilot", "robot"):
        phone.locator(f"study-screen .map .way.{who}[d^=M]").wait_for(state="attached")
    phone.get_by_role("button", name="Next participant").tap()
    phone.get_by_role("button", name="Result of T1").tap()
    phone.locator(".profiles .curve.robot").first.wait_for(state="attached")
    phone.get_by_role("button", name="Studies with participants").tap()
    with phone.expect_download() as waiting:
        phone.get_by_role("link", name="Download").tap()
    waiting.value.save_as(tmp_path / "trial.zip")
    with zipfile.ZipFile(tmp_path / "trial.zip") as packed:
        rows = list(csv.DictReader(packed.read("phases.csv").decode().splitlines()))
    assert [row["phase"] for row in rows] == ["teach", "correct", "alone", "questions"]
    assert rows[-1]["closing"] == "6" and float(rows[2]["ssd"]) >= 0
    assert int(rows[0]["frames_pilot"]) > 20
    assert rows[0]["recordings"], "the result names its recording"


def test_models_are_renamed_copied_deleted_and_brought_back(phone: Any, world: World) -> None:
    teach_both_moves(phone, world)
    phone.goto(world.address + "/#home")
    phone.get_by_role("button", name="More about Rover").tap()
    phone.get_by_label("Name").fill("Kitchen")
    phone.get_by_label("Place").fill("at home")
    phone.get_by_role("button", name="Save").tap()
    phone.locator(".model small", has_text="at home").wait_for()
    phone.get_by_role("button", name="Copy").tap()
    phone.locator(".model >> nth=1").wait_for()
    phone.get_by_role("button", name="Start over").tap()
    phone.locator("toast-bar", has_text="knows nothing").wait_for()
    wait_until(lambda: world.lessons == 0, "the robot begins with nothing")
    use = phone.get_by_role("button", name="Use this one")
    use.tap()
    wait_until(lambda: world.lessons >= 50, "what it knew is back")
    use.wait_for(state="detached")  # the list is redrawn, so a tap on the old list would be lost
    phone.get_by_role("button", name="Delete").first.tap()
    phone.locator("toast-bar button").tap()
    phone.locator(".model h3", has_text="Kitchen").first.wait_for()


SHOWN = """async () => {
  const shown = {};
  for (const { src } of document.querySelectorAll('.card img')) {
    const bytes = await (await fetch(src, { cache: 'force-cache' })).arrayBuffer();
    shown[src.match(/(\\d+)\\.png/)[1]] = [...new Uint8Array(bytes)];
  }
  return shown;
}"""
"""The bytes of each image in the gallery, as the browser has cached them."""


def test_the_gallery_shows_the_images_of_the_model_in_use(phone: Any, world: World) -> None:
    """The images of another model have the same numbers."""

    def begin_and_teach() -> dict[str, list[int]]:
        world.services.persistence.autosave.begin()
        wait_until(lambda: world.lessons == 0, "it knows nothing")
        choose(phone, world, Mode.TRAIN)
        fingers = Fingers(phone)
        hold_until(world, fingers, "left", lambda: world.lessons > 0)
        fingers.lift()
        choose(phone, world, Mode.STOPPED)
        show(phone, "gallery")
        phone.locator(".card").first.wait_for()
        return dict(phone.evaluate(SHOWN))

    seen = []
    for _ in range(2):
        seen.append(begin_and_teach())
        for node, image in seen[-1].items():
            newest = httpx.get(f"{world.address}/api/gallery/{node}.png").content
            assert bytes(image) == newest
        show(phone, "drive")
    assert seen[0]["0"] != seen[1]["0"], "it was seen from elsewhere, or this proves nothing"


def test_the_speed_that_was_set_is_the_speed_that_is_driven(
    rovers_phone: Any, rover: World
) -> None:
    phone, world = rovers_phone, rover
    phone.goto(world.address + "/#settings")
    slider = phone.get_by_role("slider", name="Speed")
    slider.wait_for()
    slider.fill("50")
    wait_until(lambda: world.rig.loop.speed_share == 0.5, "the speed is set")
    phone.goto(world.address + "/#drive")
    choose(phone, world, Mode.TRAIN)
    fingers = Fingers(phone)
    hold_until(world, fingers, "left", lambda: world.action is Action.LEFT)
    assert world.rig.loop.state.decision.speed_scale == 0.5
    fingers.lift()
