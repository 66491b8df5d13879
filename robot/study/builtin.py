"""Built-in study plans with the protocol of a published experiment: one for a study with several
participants, and one for a single person. Pure.

Source: FLAIRS-30 (2017), the experiment with human teachers. Trials 1 to 3 begin either with 90 s
of teaching and 330 s with corrections, or with 180 s of teaching and 240 s with corrections. At the
end of a trial the robot drives without help for 60 s, and the participant answers a question on a
7-point scale.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from robot.errors import ConfigurationError
from robot.study.plan import MOST_PARTICIPANTS
from robot.types import Action

FORWARD_LEFT = (Action.FORWARD, Action.LEFT)
TRIALS: Mapping[int, tuple[str, tuple[Action, ...]]] = {
    1: ("box", FORWARD_LEFT),
    2: ("office", FORWARD_LEFT),
    3: ("office", (*FORWARD_LEFT, Action.RIGHT)),
}
"""The place and the moves of each of the paper's trials."""
TIMES_S = {90: 330, 180: 240}
"""Choices of teaching time, each with its time for corrections, in seconds."""
ALONE_S = 60

_PLAN = """\
# A study with participants. Every field is described in docs/reference/study.md.
# Source of this protocol: FLAIRS-30 (2017), experiment with human teachers, trial {trial}.
title = "Trial {trial}: {seconds} seconds of teaching"
participants = {participants}
design = "within"            # every participant has all conditions; or "between": only one
world = "{world}"                # the simulator's world, or your name for the real place
moves = {moves}
learner = {learner}
questionnaires = {questionnaires}
result = {result}            # "shown": participants see their own result at the end; or "hidden"

# Text that the participant confirms before the session begins. You decide on its content; without
# this line no text is shown.
# consent = "..."            # or one per language: {{ en = "...", es = "...", zh = "..." }}

[[phase]]
kind = "teach"               # the participant drives
seconds = {teach}

[[phase]]
kind = "correct"             # the robot drives, the participant corrects it
seconds = {correct}

[[phase]]
kind = "alone"               # the robot drives without help
seconds = {alone}
{conditions}
# A question of your own; see the reference for choices and free text.
# [[question]]
# name = "fun"
# text = "It was fun."
# low = "not at all"
# high = "very much"
"""
_CONDITION = """
[[condition]]
name = "teach-{teach}"
seconds = {{ teach = {teach}, correct = {correct} }}
"""


def paper_plan(trial: int = 1) -> str:
    """Return the paper's protocol of one trial as TOML; each teaching time is a condition."""
    asked = ["nasa-tlx", "trust", "closing"]
    chosen = {"participants": 12, "questionnaires": asked, "result": "hidden"}
    return _write(trial, TIMES_S, **chosen, learner="default-32")


def trial_plan(trial: int, teach_s: int, learner: str = "default-32") -> str:
    """Return the guided trial of one person, with one teaching time and the closing question.
    Raises ConfigurationError if the trial or the teaching time is unknown."""
    if repr(trial) not in map(repr, TRIALS):  # `True` equals 1 in Python, but is not a trial number
        raise ConfigurationError(f"there is no trial {trial!r}; choose 1, 2 or 3")
    if repr(teach_s) not in map(repr, TIMES_S):
        raise ConfigurationError(f"the teaching time must be 90 or 180 s, not {teach_s!r}")
    chosen = {"participants": MOST_PARTICIPANTS, "questionnaires": ["closing"], "result": "shown"}
    return _write(trial, {teach_s: TIMES_S[teach_s]}, **chosen, learner=learner)


def _write(trial: int, times: Mapping[int, int], **fields: Any) -> str:
    (world, moves), (teach, correct) = TRIALS[trial], next(iter(times.items()))
    return _PLAN.format(
        trial=trial,
        seconds=" or ".join(map(str, times)),
        world=world,
        teach=teach,
        correct=correct,
        alone=ALONE_S,
        conditions="".join(_CONDITION.format(teach=t, correct=c) for t, c in times.items()),
        # These values have the same form in TOML as in JSON.
        **{name: json.dumps(value) for name, value in {"moves": moves, **fields}.items()},
    )
