"""A scripted participant completes a study on the page, from the consent to the table.

The participant drives by touch. The clock of a teaching phase nearly stands still until the robot
has enough examples, and then runs faster than planned, so that a slow machine also passes.
"""

from __future__ import annotations

import csv
import os
import zipfile
from pathlib import Path
from typing import Any

import httpx
import pytest

from robot.study.session import SessionStep
from robot.types import Mode
from server.study.conductor import Conductor
from server.study.extension import StudyExtension
from tests.kit.wait import wait_until

from .boxes import faults
from .hand import Fingers, choose, drive_on, teach
from .test_everyone import complaints
from .world import World


@pytest.fixture
def frame_rate_hz() -> float:
    """A higher frame rate, so that each phase teaches enough in little time."""
    return 10.0


WAITING, SLOW, FAST = 0.01, 2.0, 8.0
"""Speeds of a phase's clock: until there are enough examples, while the robot drives, and else."""
EXAMPLES = 10
PLAN = """
title = "Short or long teaching"
participants = 12
world = "box"
result = "shown"
moves = ["forward", "left"]
consent = { en = "You may stop at any time.", es = "Puede parar.", zh = "您可以随时停止。" }
[[phase]]
kind = "teach"
seconds = 6
[[phase]]
kind = "correct"
seconds = 2
[[phase]]
kind = "alone"
seconds = 2
[[condition]]
name = "short"
[[condition]]
name = "long"
seconds = { teach = 10 }
instructions = "This time you teach a little longer."
[[question]]
name = "again"
kind = "choice"
text = "Would you do it again?"
options = ["yes", "perhaps, if somebody asks me kindly and there is time", "no"]
[[question]]
name = "remark"
kind = "text"
text = "Anything else?"
when = "end"
"""


def conductor_of(world: World) -> Conductor:
    """Return the conductor of the robot's sessions."""
    conductor = world.services.extension(StudyExtension).conductor
    assert conductor is not None
    return conductor


@pytest.mark.timeout(480)
@pytest.mark.parametrize("world", ["box"], indirect=True)
def test_a_study_from_the_plan_to_its_table(
    phone: Any, world: World, tmp_path: Path, npm_modules: Path
) -> None:
    phone.evaluate((npm_modules / "axe-core" / "axe.min.js").read_text())
    before = httpx.get(f"{world.address}/api/models").json()
    a_plan_is_refused_corrected_and_created(phone, tmp_path / "walk.toml")
    phone.get_by_label("Participant’s code").fill("p01")
    phone.get_by_role("button", name="Begin the session").click()
    phone.get_by_role("button", name="I agree").wait_for()
    the_screen_fits_and_is_accessible(phone)
    phone.get_by_role("button", name="I agree").click()
    given = []
    for part in (1, 2):
        phone.get_by_role("heading", name=f"Part {part} of 2").wait_for()
        if part == 1:
            the_screen_fits_and_is_accessible(phone)
        phone.get_by_role("button", name="Begin", exact=True).click()
        the_phases_are_driven(phone, world)
        phone.locator(".notice button", has_text="Answer").click()
        given.append(the_questions_are_answered(phone, world, by_keyboard=part == 1))
    phone.get_by_text("Thank you very much").wait_for()
    the_result_is_drawn(phone)
    phone.get_by_role("button", name="Next participant").click()
    phone.get_by_role("heading", name="Participants", exact=True).wait_for()
    # the page was reloaded
    phone.evaluate((npm_modules / "axe-core" / "axe.min.js").read_text())
    the_screen_fits_and_is_accessible(phone)
    assert httpx.get(f"{world.address}/api/models").json()["models"] == before["models"]

    with phone.expect_download() as waiting:
        phone.get_by_role("link", name="Download").click()
    waiting.value.save_as(tmp_path / "walk.zip")
    with zipfile.ZipFile(tmp_path / "walk.zip") as packed:
        rows = list(csv.DictReader(packed.read("phases.csv").decode().splitlines()))
    assert [row["participant"] for row in rows] == ["P01"] * 2 * 4
    asked = [row for row in rows if row["phase"] == "questions"]
    for row, answers in zip(asked, given, strict=True):
        assert {name: row[name] for name in answers} == {n: str(v) for n, v in answers.items()}
    for row in rows:
        if row["phase"] == "teach":
            assert int(row["examples"]) >= EXAMPLES and int(row["frames_pilot"]) > 0
        if row["phase"] == "alone":
            assert int(row["frames_pilot"]) == 0 and int(row["frames_robot"]) > 0
        if row["phase"] != "questions":
            assert row["driven_s"] == row["planned_s"] and row["recordings"]


def a_plan_is_refused_corrected_and_created(page: Any, plan: Path) -> None:
    page.evaluate("location.hash = 'study'")
    page.get_by_label("Name of the study").fill("walk")
    page.get_by_label("A new study").select_option("plan")
    plan.write_text("no plan")
    for content, refusal in (("no plan", "TOML"), (PLAN, "it has changed. Choose it again.")):
        if content == "no plan":
            page.get_by_label("My plan").set_input_files(plan)
        else:
            plan.write_text(content)
            os.utime(plan, (0, 0))  # browsers compare modification times in whole seconds
        page.get_by_role("button", name="Make the study").click()
        page.locator(".refusal").filter(has_text=refusal).wait_for()
    page.get_by_label("My plan").set_input_files(plan)
    page.get_by_role("button", name="Make the study").click()


def the_phases_are_driven(page: Any, world: World) -> None:
    """Teach, and then let the robot drive, as the session's phases request."""
    session = conductor_of(world).session
    assert session is not None
    page.locator(".notice", has_text="tap “Teach”").wait_for()
    session.pace = WAITING
    choose(page, world, Mode.TRAIN)
    fingers = Fingers(page)
    teach(world, fingers, EXAMPLES)
    session.pace = FAST
    teach(world, fingers, 100_000, until=lambda: session.phase_index > 0)
    assert page.locator("teach-panel strong").text_content() == "–", "a phase hides the agreement"
    session.pace = SLOW
    drive_on(page, world, until=lambda: session.step is SessionStep.QUESTIONS)


def the_questions_are_answered(page: Any, world: World, *, by_keyboard: bool) -> dict[str, Any]:
    """Answer the questions, either by keyboard, or by touch with a reload in between; return the
    answers."""
    send = page.get_by_role("button", name="Send the answers")
    send.wait_for()
    if by_keyboard:
        the_screen_fits_and_is_accessible(page)
    form = page.locator("study-screen form")
    sliders, groups = form.get_by_role("slider").all(), form.locator("fieldset:has(.points)").all()
    assert (len(sliders), len(groups)) == (6, 4)
    names = ("mental", "physical", "temporal", "performance", "effort", "frustration")
    given: dict[str, Any] = {}
    for i, slider in enumerate(sliders):
        given[f"tlx_{names[i]}"] = 55 if by_keyboard else 10 * i
        if by_keyboard:
            slide_by_keyboard(page, slider)
        else:
            slider.fill(str(10 * i))
    for i, group in enumerate(groups):
        radio = group.get_by_role("radio").nth(i)
        given[radio.get_attribute("name")] = int(radio.get_attribute("value"))
        if by_keyboard:
            radio.focus()
            page.keyboard.press("Space")
        else:
            radio.check()
    if not by_keyboard:
        url = f"{world.address}/api/session"
        wait_until(lambda: len(httpx.get(url).json()["session"]["answers"]) == 10, "ten are saved")
        page.reload()
        send.wait_for()
    send.click()
    page.get_by_role("alert").filter(has_text="answer this too").wait_for()
    given["again"] = 2
    page.locator("input[name=again][value='2']").check()
    if page.locator("textarea").count():
        given["remark"] = "Nothing"
        page.locator("textarea").fill("Nothing")
    send.click()
    return given


def slide_by_keyboard(page: Any, slider: Any) -> None:
    slider.focus()
    for key, told in ((None, "not answered yet"), ("Space", "50"), ("ArrowRight", "55")):
        if key:
            page.keyboard.press(key)
        assert slider.get_attribute("aria-valuetext") == told, "the middle can be chosen, too"


def the_result_is_drawn(page: Any) -> None:
    page.locator(".profiles .curve.robot").first.wait_for(state="attached")
    drawn = page.locator(".profiles .curve.pilot").first.get_attribute("points")
    assert len(drawn.split()) == 101
    for who in ("pilot", "robot"):
        page.locator(f"study-screen .map .way.{who}[d^=M]").first.wait_for(state="attached")


def the_screen_fits_and_is_accessible(page: Any) -> None:
    """Check the layout of the current screen, with all parts open, at several sizes."""
    page.locator("study-screen button, study-screen a.button").first.wait_for()
    for summary in page.locator("study-screen details:not([open]) summary").all():
        summary.click()
    for width, height in ((280, 653), (844, 390), (1280, 800), (390, 844)):
        page.set_viewport_size({"width": width, "height": height})
        page.wait_for_timeout(30)
        assert faults(page) == [], f"{width}x{height}"
    assert complaints(page) == []
