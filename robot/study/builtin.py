"""The paper's protocol as a plan: the default of every study. Pure."""

from __future__ import annotations

from robot.lab.protocol import ALONE_S, TEACH_AND_ALL_S, TRIALS

_PLAN = """\
# A study with participants. Every field is described in docs/reference/study.md.
# Source of this protocol: FLAIRS-30 (2017), experiment with human teachers, trial {trial}.
title = "Trial {trial}: {seconds} seconds of teaching"
participants = 12
design = "within"            # every participant meets every condition; or "between": one each
world = "{world}"                # the simulator's world, or your name for the real place
moves = {moves}
learner = "default-32"
questionnaires = ["nasa-tlx", "trust", "closing"]

# Shown to the participant, who confirms it before anything begins. What it has to say is yours
# to decide; without this line nothing is shown.
# consent = "..."            # or one a language: {{ en = "...", es = "...", zh = "..." }}

[[phase]]
kind = "teach"               # the participant drives
seconds = {teach}

[[phase]]
kind = "correct"             # the robot drives, the participant corrects it
seconds = {correct}

[[phase]]
kind = "alone"               # the robot drives, hands off
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
    """Return the paper's protocol of one trial as TOML; the conditions are its teaching times."""
    world, moves = TRIALS[trial]
    times = [(teach, round(whole) - teach) for teach, whole in TEACH_AND_ALL_S.items()]
    conditions = "".join(_CONDITION.format(teach=teach, correct=rest) for teach, rest in times)
    return _PLAN.format(
        trial=trial,
        seconds=" or ".join(str(teach) for teach, _ in times),
        world=world,
        moves="[" + ", ".join(f'"{move}"' for move in moves) + "]",
        teach=times[0][0],
        correct=times[0][1],
        alone=round(ALONE_S),
        conditions=conditions,
    )
