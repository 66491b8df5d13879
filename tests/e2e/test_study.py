"""A study on the page: scripted participants from consent to the last answer, and the table.

DRIVELESSON_PARTICIPANTS is their number; `make test` takes one. They drive with a hand on the
glass. A phase of teaching hardly advances before enough was taught, however slow the machine, and
then runs faster than its plan says.
"""

from __future__ import annotations

import csv
import json
import random
import zipfile
from pathlib import Path
from typing import Any

import httpx
import pytest

from robot.control.state import Tick
from robot.study.session import SessionStep
from robot.types import Action, DrivenBy, Mode
from server.study.extension import StudyExtension
from tests.kit.sizes import size
from tests.kit.wait import wait_until

from .boxes import faults, speak_longer
from .hand import Fingers, choose, drive_on, teach
from .test_everyone import complaints
from .world import PHONE, World, open_page

pytestmark = [pytest.mark.browser, pytest.mark.slow]


@pytest.fixture
def frame_rate_hz() -> float:
    """A higher rate, so that each phase teaches enough in little time."""
    return 10.0


PARTICIPANTS = size("PARTICIPANTS", 1, 2)
WAITING, SLOW, FAST = 0.01, 2.0, 8.0
"""Seconds of a phase per second: until enough was taught, while the robot drives, and otherwise."""
EXAMPLES = 20
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


class Person:
    """A scripted participant with individual turns and answers."""

    def __init__(self, page: Any, world: World, number: int) -> None:
        self.page, self.world = page, world
        self.code = f"P{number:02}"
        self.dice = random.Random(number)
        self.near_m = self.dice.uniform(0.25, 0.45)
        assert world.services.extension(StudyExtension).conductor is not None
        self.conductor = world.services.extension(StudyExtension).conductor
        self.given: list[dict[str, Any]] = []

    def take_part(self) -> None:
        self.page.get_by_label("Participant’s code").fill(self.code.lower())
        self.page.get_by_role("button", name="Begin the session").click()
        self.page.get_by_role("button", name="I agree").click()
        for part in (1, 2):
            self.page.get_by_role("heading", name=f"Part {part} of 2").wait_for()
            self.page.get_by_role("button", name="Begin", exact=True).click()
            self.drive()
            self.page.locator(".notice button", has_text="Answer").click()
            self.answer(by_keyboard=part == 1, with_reload=part == 2)
        self.page.get_by_text("Thank you very much").wait_for()
        self.look_at_the_result()
        self.page.get_by_role("button", name="Next participant").click()
        self.page.get_by_role("heading", name="Participants", exact=True).wait_for()

    def look_at_the_result(self) -> None:
        self.page.locator(".profiles .curve.robot").first.wait_for(state="attached")
        drawn = self.page.locator(".profiles .curve.pilot").first.get_attribute("points")
        assert len(drawn.split()) == 101
        for who in ("pilot", "robot"):
            way = f"study-screen .map .way.{who}[d^=M]"
            self.page.locator(way).first.wait_for(state="attached")

    def drive(self) -> None:
        """Teach, then let it drive, with one correction if the phase asks for one."""
        session = self.conductor.session
        assert session is not None
        self.page.locator(".notice", has_text="tap “Teach”").wait_for()
        session.pace = WAITING
        choose(self.page, self.world, Mode.TRAIN)
        fingers = Fingers(self.page)
        driven: list[int] = []

        def note(tick: Tick) -> None:
            is_pilots = tick.decision.driven_by is DrivenBy.PILOT
            if tick.frame is not None and is_pilots and tick.sent is not Action.STOP:
                driven.append(tick.frame.frame_id)

        stop_noting = self.world.rig.loop.subscribe(note)
        teach(
            self.world,
            fingers,
            100_000,
            near_m=self.near_m,
            # A touch labels the frame that was on the screen, and drives from the next one on.
            until=lambda: min(self.world.lessons, len(driven)) >= EXAMPLES,
        )
        stop_noting()
        session.pace = FAST
        teach(
            self.world,
            fingers,
            100_000,
            near_m=self.near_m,
            until=lambda: session.phase_index > 0,
        )
        assert self.page.locator("teach-panel strong").text_content() == "–", "while it counts"
        session.pace = SLOW
        drive_on(self.page, self.world, until=lambda: session.step is SessionStep.QUESTIONS)

    def answer(self, *, by_keyboard: bool, with_reload: bool) -> None:
        self.page.get_by_role("button", name="Send the answers").wait_for()
        form = self.page.locator("study-screen form")
        sliders, groups = form.get_by_role("slider"), form.locator("fieldset:has(.points)")
        assert (sliders.count(), groups.count()) == (6, 4)
        given: dict[str, Any] = {}
        names = [f"tlx_{n}" for n in ("mental", "physical", "temporal", "performance", "effort")]
        for i, name in enumerate([*names, "tlx_frustration"]):
            given[name] = self.slide(sliders.nth(i), by_keyboard=by_keyboard)
        for i in range(4):
            radio = groups.nth(i).get_by_role("radio").nth(self.dice.randrange(7))
            given[radio.get_attribute("name")] = int(radio.get_attribute("value"))
            if by_keyboard:
                radio.focus()
                self.page.keyboard.press("Space")
            else:
                radio.check()
        if with_reload:
            wait_until(lambda: len(self.answers()) == 10, "each answer is kept at once")
            self.page.reload()
            self.page.get_by_role("button", name="Send the answers").wait_for()
        self.page.get_by_role("button", name="Send the answers").click()
        self.page.get_by_role("alert").filter(has_text="answer this too").wait_for()
        given["again"] = self.dice.randint(1, 3)
        self.page.locator(f"input[name=again][value='{given['again']}']").check()
        remark = self.page.locator("textarea")
        if remark.count():
            remark.fill(f"Nothing, says {self.code}")
            given["remark"] = f"Nothing, says {self.code}"
        self.page.get_by_role("button", name="Send the answers").click()
        self.given.append(given)

    def slide(self, slider: Any, *, by_keyboard: bool) -> int:
        value = 5 * self.dice.randrange(21)
        if not by_keyboard:
            slider.fill(str(value))
            return value
        slider.focus()
        assert slider.get_attribute("aria-valuetext") == "not answered yet"
        self.page.keyboard.press("Space")
        assert slider.get_attribute("aria-valuetext") == "50", "the middle can be chosen, too"
        self.page.keyboard.press("ArrowRight")
        assert slider.get_attribute("aria-valuetext") == "55"
        return 55

    def answers(self) -> dict[str, str]:
        return dict(httpx.get(f"{self.world.address}/api/session").json()["session"]["answers"])


@pytest.mark.timeout(240 + 240 * PARTICIPANTS)
@pytest.mark.parametrize("world", ["box"], indirect=True)
def test_a_study_from_the_plan_to_its_table(phone: Any, world: World, tmp_path: Path) -> None:
    assert world.services.extension(StudyExtension).conductor is not None
    before = httpx.get(f"{world.address}/api/models").json()
    phone.evaluate("location.hash = 'study'")
    (tmp_path / "walk.toml").write_text(PLAN)
    phone.get_by_label("Name of the study").fill("walk")
    phone.get_by_label("A new study").select_option("plan")
    phone.get_by_label("My plan").set_input_files(tmp_path / "walk.toml")
    phone.get_by_role("button", name="Make the study").click()
    people = [Person(phone, world, number) for number in range(1, PARTICIPANTS + 1)]
    for person in people:
        person.take_part()
    assert httpx.get(f"{world.address}/api/models").json()["models"] == before["models"]

    with phone.expect_download() as waiting:
        phone.get_by_role("link", name="Download").click()
    file = tmp_path / "walk.zip"
    waiting.value.save_as(file)
    with zipfile.ZipFile(file) as packed:
        rows = list(csv.DictReader(packed.read("phases.csv").decode().splitlines()))
    assert len(rows) == len(people) * 2 * 4
    for person in people:
        mine = [row for row in rows if row["participant"] == person.code]
        asked = [row for row in mine if row["phase"] == "questions"]
        for row, given in zip(asked, person.given, strict=True):
            assert {name: row[name] for name in given} == {n: str(v) for n, v in given.items()}
        for row in mine:
            if row["phase"] == "teach":
                assert min(int(row["examples"]), int(row["frames_pilot"])) >= EXAMPLES
            if row["phase"] == "alone":
                assert int(row["frames_pilot"]) == 0 and int(row["frames_robot"]) > 0
            if row["phase"] != "questions":
                assert row["driven_s"] == row["planned_s"] and row["recordings"]


SIZES = [(280, 653), (320, 480), (844, 390), (1280, 800)]


@pytest.mark.parametrize("world", ["box"], indirect=True)
def test_every_screen_of_a_study_fits_and_is_accessible(
    chromium: Any, world: World, npm_modules: Path
) -> None:
    axe = (npm_modules / "axe-core" / "axe.min.js").read_text()
    conductor = world.services.extension(StudyExtension).conductor
    assert conductor is not None
    conductor.pace = 100.0
    post(world, "/api/studies", name="elsewhere", trial=2)
    post(world, "/api/studies", name="walk", plan=PLAN)
    context = chromium.new_context(viewport=PHONE, has_touch=True, service_workers="block")
    speak_longer(context)
    page = open_page(context, world.address)
    page.evaluate(axe)
    wrong: list[str] = []

    def look(what: str) -> None:
        page.evaluate("location.hash = 'drive'")
        page.evaluate("location.hash = 'study'")
        page.locator("study-screen button, study-screen a.button").first.wait_for()
        for summary in page.locator("study-screen details:not([open]) summary").all():
            summary.click()
        for width, height in SIZES:
            page.set_viewport_size({"width": width, "height": height})
            page.wait_for_timeout(30)
            wrong.extend(f"{what}, {width}x{height}: {fault}" for fault in faults(page))
        page.set_viewport_size(PHONE)
        wrong.extend(f"{what}: {complaint}" for complaint in complaints(page))

    post(world, "/api/session", study="elsewhere", participant="P09")
    page.evaluate("location.hash = 'study'")
    page.locator("study-screen .primary").click()
    page.get_by_role("alert").filter(has_text="under Settings, Place").wait_for()
    assert httpx.get(f"{world.address}/api/models").json()["models"] == []
    httpx.delete(f"{world.address}/api/session")
    post(world, "/api/session", study="walk", participant="P01")
    look("consent")
    post(world, "/api/session/consent", language="en")
    look("ready")
    post(world, "/api/session/drive")
    page.evaluate("location.hash = 'drive'")
    session = conductor.session
    assert session is not None
    for _ in range(200):
        phase = session.phase
        if phase is None:
            break
        if world.mode is not phase.mode:
            page.locator(f"mode-bar [data-mode={phase.mode.value}]").click()
        page.wait_for_timeout(100)
    assert session.step is SessionStep.QUESTIONS
    look("questions")
    httpx.delete(f"{world.address}/api/session")
    look("the list")
    context.close()
    assert wrong == []


def post(world: World, path: str, **body: Any) -> None:
    answer = httpx.post(world.address + path, content=json.dumps(body))
    assert answer.status_code in (200, 201), answer.text
