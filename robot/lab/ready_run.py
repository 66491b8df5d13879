"""One pilot who follows the page's hints until it shows "ready", and the minute after."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

from robot.control.readiness import NOVEL_SHARE, Readiness, Stage
from robot.lab.habit_run import DRIFT_SHARE, make_habit_pilot
from robot.lab.ideas import make_learner
from robot.lab.metrics import driving
from robot.lab.simulated_pilots.habits import HABITS
from robot.lab.task import Result
from robot.lab.trial import Place, Trial
from robot.types import Action, Mode

TEACH_STEP_S, TRY_STEP_S = 10.0, 40.0


def run_ready(params: Mapping[str, Any]) -> Result:
    """Teach, try and teach again as `Readiness` advises, then let it drive alone for a minute.

    Parameters: `habit`, `world`, `learner`, `rate_hz`, `seed`, `limit_s`, `in_time_s`, `drift`. The
    result's `missing` is what the page says after `in_time_s`, or in the end.
    """
    habit = HABITS[params["habit"]]
    moves = (Action.FORWARD, *habit.turns)
    limit_s = params["limit_s"]
    in_time_s = params.get("in_time_s", limit_s)
    readiness = Readiness()
    started_s = time.perf_counter()
    with Trial(
        Place(world=params["world"], seed=params["seed"]),
        make_learner(params["learner"], moves),
        make_habit_pilot(habit, f"ready {params['habit']} {params['seed']}"),
        rate_hz=params["rate_hz"],
        drift=params.get("drift", DRIFT_SHARE),
    ) as trial:
        trial.loop.subscribe(readiness.note)
        taught_s = tried_s = 0.0
        missing: list[str] = []
        must_teach = True
        while readiness.stage is not Stage.READY and taught_s + tried_s < limit_s:
            if not missing and taught_s + tried_s >= in_time_s:
                missing = _missing(readiness)
            if must_teach or readiness.stage is Stage.TEACH:
                taught_s += trial.drive(Mode.TRAIN, TEACH_STEP_S).seconds
                must_teach = False
                continue
            tried_s += trial.drive(
                Mode.AUTONOMOUS, TRY_STEP_S, until=lambda moment: readiness.stage is Stage.READY
            ).seconds
            must_teach = readiness.novel_share > NOVEL_SHARE
        is_ready = readiness.stage is Stage.READY
        missing = missing or _missing(readiness)
        agreement = trial.loop.state.agreement
        alone = trial.drive(Mode.AUTONOMOUS, 60.0, supervised=False)
        frames = trial.frames
    return {
        "is_ready": is_ready,
        "taught_s": taught_s,
        "tried_s": tried_s,
        "missing": missing,
        "agreement": agreement,
        "foreseen": dict(readiness.foreseen),
        **driving.figures(alone),
        "timing": {"frames": frames, "frames_per_s": frames / (time.perf_counter() - started_s)},
    }


def _missing(readiness: Readiness) -> list[str]:
    return [gap.kind.value for gap in readiness.missing()]
