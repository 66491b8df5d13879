"""Tests whether a robot that the page calls ready is really ready.

Forty pilots follow the page's hints; then the robot drives for a minute.
"""

from __future__ import annotations

import statistics
from collections.abc import Iterator

from robot.coaching.gaps import Stage
from robot.coaching.lesson import Lesson
from robot.coaching.trial_drive import NOVEL_SHARE
from robot.lab import metrics
from robot.lab.experiment import Experiment, ExperimentSettings, Runs
from robot.lab.habits import RATES_HZ, WORLDS, taught_by
from robot.lab.simulated_pilots.habits import HABITS
from robot.lab.tables import Columns, mean_percent, of, percent, tables_of
from robot.lab.task import Params, Result, Task
from robot.study.table import Table
from robot.types import Mode

PILOTS = 40
IN_TIME_S = 240.0
LIMIT_S = 1200.0
FIRST_SEED = 700


def _plan(settings: ExperimentSettings) -> Iterator[Task]:
    """Plan one run for each pilot. There are forty pilots for every ten `seeds`, and at least
    forty."""
    habits = list(HABITS)
    for number in range(2 if settings.quick else PILOTS * max(1, settings.n_seeds // 10)):
        turn = number + number // len(habits)
        params = {
            "habit": habits[number % len(habits)],
            "world": WORLDS[turn % len(WORLDS)],
            "rate_hz": RATES_HZ[turn % len(RATES_HZ)],
            "learner": settings.learner,
            "seed": FIRST_SEED + number,
            "in_time_s": IN_TIME_S,
            "limit_s": LIMIT_S,
        }
        yield Task(run_ready, params)


def _tables(runs: Runs) -> list[Table]:
    """Return one table with rows for robots that were ready in time, later, or never."""
    called = [("The minute after", _when(result), result) for _, result in runs]
    called.sort(key=lambda each: ("within four minutes", "later", "never").index(each[1]))
    return tables_of(called, _COLUMNS, "called ready")


_COLUMNS: Columns = {
    "runs": len,
    "told what is missing": of("missing", lambda each: sum(map(bool, each))),
    "taught and tried s, median": lambda results: statistics.median(
        result["taught_s"] + result["tried_s"] for result in results
    ),
    "asked, mean": of("asking_share", mean_percent),
    "asked, most": of("asking_share", lambda shares: percent(max(shares), 1)),
    "asked 5 % or more": of("asking_share", lambda shares: sum(s >= 0.05 for s in shares)),
    "longest push s": of("longest_push_s", max),
    "pushed over 1 s": of("longest_push_s", lambda pushes_s: sum(s > 1.0 for s in pushes_s)),
    "stuck": of("stuck", sum),
    "agreement, mean": of("agreement", lambda each: statistics.fmean(a or 0.0 for a in each)),
}


def _when(result: Result) -> str:
    if not result["is_ready"]:
        return "never"
    is_in_time = round(result["taught_s"] + result["tried_s"]) <= IN_TIME_S
    return "within four minutes" if is_in_time else "later"


TEACH_STEP_S, TRY_STEP_S = 10.0, 40.0


def run_ready(params: Params) -> Result:
    """Teach a robot, and let it try to drive, in the order that `Lesson` advises. When the robot is
    ready, or after `limit_s`, let it drive without help for a minute.

    Parameters: `habit`, `world`, `learner`, `rate_hz`, `seed`, `limit_s`, `in_time_s`. `missing` in
    the result is the page's list of what the robot still has to learn, after `in_time_s` seconds,
    or at the end if the robot is ready earlier.
    """
    habit, lesson = HABITS[params["habit"]], Lesson()
    limit_s, in_time_s = params["limit_s"], params["in_time_s"]
    name = f"ready {params['habit']} {params['seed']}"
    with taught_by(habit, name, params) as trial:
        trial.loop.subscribe(lesson.note)
        taught_s = tried_s = 0.0
        missing: list[str] = []
        must_teach = True
        while lesson.stage is not Stage.READY and taught_s + tried_s < limit_s:
            if not missing and taught_s + tried_s >= in_time_s:
                missing = _missing(lesson)
            if must_teach or lesson.stage is Stage.TEACH:
                taught_s += trial.drive(Mode.TRAIN, TEACH_STEP_S).seconds
                must_teach = False
                continue
            tried_s += trial.drive(
                Mode.AUTONOMOUS, TRY_STEP_S, until=lambda moment: lesson.stage is Stage.READY
            ).seconds
            must_teach = lesson.trial.novel_share > NOVEL_SHARE
        is_ready = lesson.stage is Stage.READY
        missing = missing or _missing(lesson)
        agreement = trial.loop.state.agreement
        alone = trial.drive(Mode.AUTONOMOUS, 60.0, supervised=False)
    return {
        "is_ready": is_ready,
        "taught_s": taught_s,
        "tried_s": tried_s,
        "missing": missing,
        "agreement": agreement,
        **metrics.figures(alone),
        "timing": trial.timing,
    }


def _missing(lesson: Lesson) -> list[str]:
    return [gap.kind.value for gap in lesson.missing()]


READY = Experiment(
    title="Ready means ready",
    text="Pilots of all habits in all places teach, let the robot try while they are ready to take "
    "the wheel, and teach again, as robot/coaching/lesson.py advises, for at most twenty "
    "minutes. Then the robot drives a minute unaided.",
    plan=_plan,
    tables=_tables,
)
