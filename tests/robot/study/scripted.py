"""A scripted participant for a study session without a server.

The participant advances the session tick by tick, answers its questions and returns its log.
"""

import random

import numpy as np

from robot.control.state import Tick
from robot.driver import Sensors
from robot.study.events import StudyEvent, write_events
from robot.study.plan import StudyPlan, parse_plan
from robot.study.session import SessionStep, StudySession
from robot.types import Action, Decision, DrivenBy, Mode
from tests.kit.frames import frame_of

SMALL_PLAN = """
title = "Two times"
participants = 4
world = "box"
moves = ["forward", "left"]
consent = "You may stop at any time."

[[phase]]
kind = "teach"
seconds = 3
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
seconds = { teach = 6 }

[[question]]
name = "remark"
kind = "text"
text = "Anything else?"
when = "end"
[[question]]
name = "again"
kind = "choice"
text = "Would you do it again?"
options = ["yes", "no"]
"""
How = tuple[Mode, DrivenBy, Action, float | None]
"""A participant's robot: its mode, its driver, its move, and the metres to the obstacle ahead."""


def small_plan() -> StudyPlan:
    return parse_plan(SMALL_PLAN)


def tick(now_s: float, how: How) -> Tick:
    mode, by, action, distance_m = how
    return Tick(
        now_s=now_s,
        frame=frame_of(np.zeros((1, 1))),
        decision=Decision(action=action, driven_by=by, mode=mode),
        sent=action,
        sensors=Sensors(distance_m=distance_m),
    )


class Participant:
    """One session without a robot; `events` is its log."""

    def __init__(
        self, plan: StudyPlan, code: str = "P01", slot: int = 0, seed: int = 0, pace: float = 1.0
    ) -> None:
        self.session = StudySession(plan, code, slot, pace=pace)
        self.dice = random.Random(f"{seed}/{code}")
        self.now_s = 100.0
        self.events: list[StudyEvent] = []
        self.say("session_begun", value=str(slot))

    def say(self, event: str, **fields: object) -> None:
        self.events.append(self.session.make(event, 1.7e9 + self.now_s, **fields))

    def consent(self) -> None:
        self.say("consent", name="en")

    def begin(self) -> None:
        self.say("condition_begun", attempt=self.session.attempt + 1)
        self.say("world", name="simulator", value="box")

    def drive(self, seconds: float, mode: Mode | None = None, how: How | None = None) -> None:
        """Tick ten times a second with the states of `how`, which may go on after the last phase.

        Without `how`, the states are random, in the phase's mode or another one."""
        for _ in range(round(seconds * 10)):
            if self.session.phase is None and how is None:
                return
            self.now_s += 0.1
            made = tick(self.now_s, how or self._how(mode))
            self.events += self.session.note(made, 1.7e9 + self.now_s, lambda: {"examples": "7"})

    def _how(self, mode: Mode | None) -> How:
        kind = self.session.phase.kind
        is_pilot = kind == "teach" or (kind == "correct" and self.dice.random() < 0.1)
        action = self.dice.choice([Action.FORWARD, Action.LEFT])
        by = DrivenBy.PILOT if is_pilot else DrivenBy.ROBOT
        mode = mode or self.session.phase.mode
        if mode is Mode.STOPPED:
            action, by = Action.STOP, DrivenBy.NOBODY
        return mode, by, action, self.dice.uniform(0.1, 2.0)

    def answer(self) -> None:
        for question in self.session.questions:
            if question.kind == "text":
                answer: object = 'It said "no", =1+1, twice'
            elif question.kind == "choice":
                answer = self.dice.randint(1, len(question.options))
            else:
                answer = self.dice.randrange(question.least, question.most + 1, question.step)
            self.say("answer", name=question.name, value=question.check(answer))
        self.say("answered")

    def take_part(self) -> None:
        """Complete the session from its current step."""
        steps = {
            SessionStep.CONSENT: self.consent,
            SessionStep.READY: self.begin,
            SessionStep.DRIVE: lambda: self.drive(1.0),
            SessionStep.QUESTIONS: self.answer,
        }
        while self.session.step is not SessionStep.DONE:
            steps[self.session.step]()
        self.say("session_ended")

    @property
    def log(self) -> bytes:
        return write_events(self.events, with_head=True).encode()


def driving(seconds: float = 0.0) -> Participant:
    """Return a participant who has consented, begun the first condition, and driven for this
    time."""
    person = Participant(small_plan())
    person.consent()
    person.begin()
    person.drive(seconds)
    return person


def logs_of(n: int, seed: int = 0) -> dict[str, bytes]:
    """Return the logs of this number of participants who complete the study."""
    people = [Participant(small_plan(), f"P{i + 1:02}", i, seed) for i in range(n)]
    for person in people:
        person.take_part()
    return {person.session.participant: person.log for person in people}
