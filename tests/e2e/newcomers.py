"""Twelve scripted newcomers use the real page: python -m tests.e2e.newcomers

Each newcomer opens the page for the first time, follows its sentences, and drives by real touch
events with the irregular hand of one of `robot/lab/simulated_pilots/habits.py`. While the robot
drives, the newcomer first corrects it by habit; once the page has said when to touch it, only then.
Each newcomer has another screen and language: five sizes, and en, es, zh in turn. The requirement:
within four minutes of opening the page, the robot drives by itself for a minute without pushing a
wall.

Everything runs in real time: a newcomer takes two to four minutes. `--habits regular,late` chooses
the newcomers with these habits.
"""

from __future__ import annotations

import argparse
import contextlib
import re
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robot.lab.simulated_pilots.habits import HABITS
from robot.lab.simulated_pilots.situation import Situation, observe
from robot.lab.simulated_pilots.teachers import Teacher
from robot.types import Action, DrivenBy, Mode

from .hand import Fingers, pad
from .world import World, new_context, running_chromium, running_world, sentences

LIMIT_S = 240.0
SOON_S = 120.0
ALONE_S = 60.0
RATE_HZ = 10.0
"""Pictures a second, like the camera of a real EV3. Tests of the page use half of this rate, at
which a robot learns half as much in the same time, and reacts later."""
PUSHED_S = 0.5
"""A contact that lasts longer than this counts as pushing."""
READ_EVERY_S = 0.4
READING_S = 1.5
"""Time for which a person reads a sentence before following it."""
SIZES = ((390, 844), (360, 640), (844, 390), (320, 568), (768, 1024))
LANGUAGES = ("en", "es", "zh")
TOLD = {
    "lenient": ("hint.correct", "advice.trial", "advice.can"),
    "hand over": ("advice.try", "advice.ready"),
    "teach": ("hint.teach", "advice.start", "advice.more", "advice.first"),
    "go on": ("stop.", "local.", "busy.", "emergency", "out_of_reach", "way."),
}
"""The action that the page's sentences request, by the beginnings of their keys."""
_TEXT = """() => {
  const notice = document.querySelector('.notice:not([hidden]) p');
  return (notice ?? document.querySelector('.advice')).textContent;
}"""


@dataclass(slots=True)
class Story:
    """The result of one newcomer. Times are in seconds since the page was opened."""

    habit: str
    screen: str
    language: str
    first_move_s: float | None = None
    handed_over_s: float | None = None
    called_ready_s: float | None = None
    done_s: float | None = None
    corrections: int = 0
    longest_push_s: float = 0.0
    """The time for which the robot pushed while it drove by itself."""

    @property
    def is_done(self) -> bool:
        return self.done_s is not None and self.done_s <= LIMIT_S


class Lenient:
    """A teacher who has read when to correct: before a bump, or when the robot stands.

    Before that, the teacher corrects everything that it would do differently.
    """

    def __init__(self, teacher: Teacher) -> None:
        self._teacher, self.is_lenient = teacher, False

    def choose(self, situation: Situation) -> Action:
        return self._teacher.choose(situation)

    def tolerates(self, situation: Situation, action: Action) -> bool:
        is_tolerated = self._teacher.tolerates(situation, action)
        if not self.is_lenient or action in (Action.FORWARD, Action.STOP):
            return is_tolerated
        return not situation.is_pushing


class Newcomer:
    """A newcomer who reads the page, taps as requested, and holds directions by a habit."""

    def __init__(self, page: Any, world: World, story: Story, opened_s: float) -> None:
        self.page, self.world, self.opened_s = page, world, opened_s
        self.story, habit = story, story.habit
        self._words = sentences(story.language)
        self._fingers = Fingers(page)
        self._pilot = HABITS[habit].pilot(f"newcomer {habit}")
        self._judge = self._pilot.teacher = Lenient(self._pilot.teacher)
        self._held: Action | None = None
        self._text, self._text_since_s, self._read_s = "", 0.0, 0.0
        self._wanted = Mode.TRAIN
        self._alone_since_s: float | None = None
        self._pushing_since_s: float | None = None

    @property
    def now_s(self) -> float:
        return time.monotonic() - self.opened_s

    def live(self) -> Story:
        """Teach, and let the robot drive, until the minute is complete or the time is over."""
        while not self.story.is_done and self.now_s < LIMIT_S:
            self._go_on()
            self._watch()
        self._hold(None)
        return self.story

    def _go_on(self) -> None:
        """Read the page if it is time to read, then drive for a moment."""
        if self.now_s - self._read_s > READ_EVERY_S:
            self._read()
        self._drive()
        time.sleep(0.03)

    # Reading -----------------------------------------------------------------------------------

    def _read(self) -> None:
        self._read_s = self.now_s
        text = self.page.evaluate(_TEXT)
        if text != self._text:
            self._text, self._text_since_s = text, self.now_s
        if text and self.now_s - self._text_since_s > READING_S:
            self._do_as_told(text)

    def _do_as_told(self, text: str) -> None:
        """Do what the page's sentence requests, in any language."""
        mode, told = self.world.mode, asked_by(text, self._words)
        if told == "lenient":
            self._judge.is_lenient = True
            if self.story.called_ready_s is None and is_said("advice.can", text, self._words):
                self.story.called_ready_s = self.now_s
        if mode is not Mode.AUTONOMOUS and told == "hand over":
            self.story.handed_over_s = self.story.handed_over_s or self.now_s
            self._choose(Mode.AUTONOMOUS)
        elif mode is Mode.STOPPED and told == "teach":
            self._choose(Mode.TRAIN)
        elif mode is Mode.STOPPED and (told == "go on" or "and go on" in text):  # after a fault
            self._choose(self._wanted)
        elif self.page.locator(".notice button", has_text=self._words["step.hint"]).is_visible():
            self._tap(".notice button")

    def _choose(self, mode: Mode) -> None:
        self._wanted = mode
        self._tap(f"mode-bar [data-mode={mode.value}]")
        self._pilot.change_mode(mode)

    def _tap(self, selector: str) -> None:
        self._hold(None)  # use the mouse, because browsers send no click for a second finger
        with contextlib.suppress(Exception):  # the control may disappear before the finger arrives
            self._fingers.press(selector, finger=2)
            self._fingers.lift(finger=2)

    # Driving -----------------------------------------------------------------------------------

    def _drive(self) -> None:
        state = self.world.rig.loop.state
        mode = state.decision.mode
        if mode is not self._pilot.mode:
            self._pilot.change_mode(mode)
        simulation = self.world.rig.driver.simulation
        now_s, frame_id = self.now_s, state.frame_id or 0
        prediction = state.prediction
        situation = observe(simulation, frame_id, now_s)
        command = self._pilot.act(situation, prediction.action if prediction else None)
        self._hold(command.held if mode is not Mode.STOPPED else None)

    def _hold(self, move: Action | None) -> None:
        if move is self._held:
            return
        if move is None:
            self._fingers.lift()
        elif self._held is None:
            self._fingers.press(pad(move.value))
        else:
            self._fingers.slide(pad(move.value))
        if move is not None and self.story.first_move_s is None:
            self.story.first_move_s = self.now_s
        if move is not None and self._held is None and self.world.mode is Mode.AUTONOMOUS:
            self.story.corrections += 1
        self._held = move

    # Judging -----------------------------------------------------------------------------------

    def _watch(self) -> None:
        """Measure how long the robot has driven by itself without pushing."""
        decision, now_s = self.world.rig.loop.state.decision, self.now_s
        is_alone = decision.driven_by is DrivenBy.ROBOT and not decision.asks_pilot
        if not is_alone or self._held is not None:
            self._alone_since_s = self._pushing_since_s = None
            return
        self._alone_since_s = self._alone_since_s or now_s
        if not self.world.rig.driver.simulation.is_pushing:
            self._pushing_since_s = None
        else:
            self._pushing_since_s = self._pushing_since_s or now_s
            pushed_s = now_s - self._pushing_since_s
            self.story.longest_push_s = max(self.story.longest_push_s, pushed_s)
            if pushed_s > PUSHED_S:
                self._alone_since_s = now_s
        if now_s - self._alone_since_s >= ALONE_S:
            self.story.done_s = now_s


def is_said(key: str, text: str, words: dict[str, str]) -> bool:
    """True if a text is the sentence with this key, filled with any values."""
    return re.fullmatch(re.sub(r"\\{\w+\\}", ".*", re.escape(words[key])), text) is not None


def asked_by(text: str, words: dict[str, str]) -> str | None:
    """Return the action that a text on the drive screen requests."""
    for asked, names in TOLD.items():
        if any(is_said(key, text, words) for key in words if key.startswith(names)):
            return asked
    return None


def run(story: Story, world_name: str) -> Story:
    """Return the result of a newcomer with a new robot and a new browser."""
    width, height = map(int, story.screen.split("x"))
    with (
        tempfile.TemporaryDirectory() as kept,
        running_world(Path(kept), world=world_name, frame_rate_hz=RATE_HZ) as world,
        running_chromium() as browser,
    ):
        size = {"width": width, "height": height}
        context = new_context(browser, size, locale=story.language, reduced_motion="no-preference")
        page = context.new_page()
        opened_s = time.monotonic()
        page.goto(world.address)
        page.wait_for_selector("video-view[data-frames]", state="attached", timeout=20_000)
        return Newcomer(page, world, story, opened_s).live()


def main() -> int:
    """Run the newcomers one after the other; return 0 if at most one in twelve fails."""
    parser = argparse.ArgumentParser(prog="python -m tests.e2e.newcomers", description=__doc__)
    parser.add_argument("--habits", default=",".join(HABITS), help="comma-separated")
    parser.add_argument("--world", default="box")
    args = parser.parse_args()
    stories = []
    print("habit        screen          taps  hands over   ready    done  corrected  longest push")
    for habit in args.habits.split(","):
        i = list(HABITS).index(habit)
        (width, height), language = SIZES[i % len(SIZES)], LANGUAGES[i % len(LANGUAGES)]
        story = run(Story(habit, f"{width}x{height}", language), args.world)
        stories.append(story)
        times = (story.first_move_s, story.handed_over_s, story.called_ready_s, story.done_s)
        told = [f"{at_s:5.0f} s" if at_s is not None else "   none" for at_s in times]
        print(
            f"{habit:11} {story.screen:8} {language} {told[0]}     {told[1]} {told[2]} {told[3]}  "
            f"{story.corrections:9} {story.longest_push_s:11.2f} s",
            flush=True,
        )
    done = sum(story.is_done for story in stories)
    soon = sum((story.done_s or LIMIT_S) <= SOON_S for story in stories)
    print(f"{done} of {len(stories)} robots drove by themselves for a minute within 4 minutes")
    print(f"{soon} of them did so within {SOON_S:.0f} s")
    return 0 if 12 * done >= 11 * len(stories) else 1


if __name__ == "__main__":
    raise SystemExit(main())
