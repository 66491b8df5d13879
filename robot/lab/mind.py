"""Experiment on pilots who change their minds. At walls, the pilot turns LEFT in a lesson of one
minute, and then RIGHT in two lessons of half a minute each."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence

from robot.lab.experiment import Experiment, ExperimentSettings, Runs, seeded
from robot.lab.ideas import make_learner
from robot.lab.simulated_pilots.habits import HABITS
from robot.lab.simulated_pilots.teachers import TEACHER_PARAMS
from robot.lab.tables import Columns, percent, tables_of
from robot.lab.task import Params, Result, Task
from robot.lab.trial import Trial, drive_by_hand
from robot.policy.policy import Policy
from robot.study.table import Table
from robot.types import Action, Mode

WORLDS = ("box", "office", "clutter")
LEARNERS = ("default-32", "without-forgetting-32")
FIRST_SEED = 900
NEVER_LEFT = ", never taught left"
SAYS_SO = ", who is told"


def _plan(settings: ExperimentSettings) -> Iterator[Task]:
    """Plan runs of every learner in every place, alternately at 10 and 30 frames a second."""
    learners = settings.learners or LEARNERS
    others = ((learners[0], 60.0, True), (learners[0], 0.0, False))
    cases = (
        {"world": world, "learner": learner, "old_s": old_s, "is_told": is_told}
        for learner, old_s, is_told in (*((name, 60.0, False) for name in learners), *others)
        for world in WORLDS[: 1 if settings.quick else None]
    )
    return seeded(run_mind, cases, settings, FIRST_SEED, least=1 if settings.quick else 2)


def _tables(runs: Runs) -> list[Table]:
    rows = []
    for task, result in runs:
        said = SAYS_SO if task.params["is_told"] else "" if task.params["old_s"] else NEVER_LEFT
        name = f"{task.params['learner']}{said}"
        last = {**result["second"], "alone": result["alone"]}
        rows += [(f"{name}, after 30 s", result["first"]), (f"{name}, after 60 s", last)]
    return tables_of((("Where the pilot turns right", *row) for row in rows), _COLUMNS)


def _rights(views: Sequence[Result]) -> list[float]:
    return [each["right"] / each["blocked"] for each in views if each["blocked"]]


def _share(counts: Sequence[dict[str, int]], part: str, whole: str) -> str:
    total = sum(count[whole] for count in counts)
    return percent(sum(count[part] for count in counts) / max(total, 1))


_COLUMNS: Columns = {
    "runs": lambda views: len(_rights(views)),
    "right, median": lambda views: percent(statistics.median(_rights(views))),
    "mean": lambda views: percent(statistics.fmean(_rights(views))),
    "least": lambda views: percent(min(_rights(views))),
    "left": lambda views: _share(views, "left", "blocked"),
    "of all": lambda views: _share(views, "turning_right", "turning"),
    "own turns": lambda views: (
        _share([each["alone"] for each in views], "right", "turns") if "alone" in views[0] else None
    ),
}


BLOCKED_M = TEACHER_PARAMS["usual"].turn_at_m
"""Free distance ahead below which both pilots turn, in metres. The robot is tested on views with
less free distance than `BLOCKED_M`."""
LOOKS_HZ = 10.0
NEW_S, ASKED_S, ALONE_S = 30.0, 40.0, 60.0


def run_mind(params: Params) -> Result:
    """Teach a robot LEFT, then RIGHT twice. Test it after each RIGHT lesson, and let it drive.

    Parameters: `world`, `learner`, `seed`, `old_s` and `is_told`. `old_s` is the duration of the
    lesson with LEFT, in seconds. If `is_told` is true, the pilot declares the change of mind before
    RIGHT is taught.
    """
    world, seed = params["world"], params["seed"]
    rate_hz = (10.0, 30.0)[seed % 2]
    old, new = (HABITS[side].pilot(f"{side} {seed}") for side in ("left", "right"))
    policy = make_learner(params["learner"], (Action.FORWARD, Action.LEFT, Action.RIGHT))
    result: Result = {}
    with Trial(world, seed, policy, old, rate_hz=rate_hz) as trial:
        if params["old_s"]:
            trial.drive(Mode.TRAIN, params["old_s"])
        trial.pilot = new
        if params["is_told"]:
            trial.loop.history.edit("outdate")
        for name in ("first", "second"):
            trial.drive(Mode.TRAIN, NEW_S)
            result[name] = ask(policy, world, seed, ASKED_S)
        alone = trial.drive(Mode.AUTONOMOUS, ALONE_S, supervised=False)
    turns = [action for action in alone.actions() if action in (Action.LEFT, Action.RIGHT)]
    result["alone"] = {"turns": len(turns), "right": turns.count(Action.RIGHT)}
    return result


def ask(policy: Policy, world: str, seed: int, seconds: float) -> dict[str, int]:
    """Return which moves the policy would make on views at which the new pilot turns. The policy
    learns nothing.

    Returns:
        Numbers of views, among the views at which the pilot turns RIGHT.

        - `turning`: all views; `turning_right`: those on which the policy would turn RIGHT, too.
        - `blocked`: the views with less than `BLOCKED_M` of free way; `right` and `left`: those on
          which the policy would turn RIGHT or LEFT.
    """
    policy.reset()
    pilot = HABITS["right"].pilot(f"asked {seed}")
    drive = drive_by_hand(world, seed + 1000, pilot, seconds, LOOKS_HZ, watching=policy)
    policy.reset()
    turning = [moment for moment in drive if moment.wanted is Action.RIGHT]
    blocked = [
        moment.proposed
        for moment in turning
        if moment.situation is not None and moment.situation.free_ahead_m < BLOCKED_M
    ]
    return {
        "blocked": len(blocked),
        "right": blocked.count(Action.RIGHT),
        "left": blocked.count(Action.LEFT),
        "turning": len(turning),
        "turning_right": sum(moment.proposed is Action.RIGHT for moment in turning),
    }


MIND = Experiment(
    title="A changed mind",
    text="A pilot who turns only left teaches for a minute. Then a pilot who turns only right "
    "teaches for half a minute, and again for half a minute. After each half minute the robot "
    "is asked, without learning, what it would do where the second pilot turns right. 'who is "
    "told': the second pilot first declares the change of mind. 'right': the share of views "
    "with less than 22 cm of free way on which the robot would turn right. 'of all': the same "
    "share of all views on which the pilot turns; towards the end of a turn, one view may mean "
    "both sides. 'own turns': the share of right turns among the robot's turns in an unaided "
    "minute afterwards. The rows 'never taught left' are the best that a robot can reach.",
    plan=_plan,
    tables=_tables,
)
