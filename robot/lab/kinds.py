"""The kinds of tasks: each turns parameters into plain figures."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

from robot.control.profile import Profile, compare, move_shares, rare_moves
from robot.lab.cycles import run_cycles
from robot.lab.episodes import run_episodes
from robot.lab.footage import run_recorded_footage, run_simulated_footage
from robot.lab.ground.run import run_ground
from robot.lab.habit_run import run_habit
from robot.lab.ideas import make_learner
from robot.lab.metrics import driving
from robot.lab.metrics.log import DriveLog
from robot.lab.mind_run import run_mind
from robot.lab.pilots import make_pilot
from robot.lab.ready_run import run_ready
from robot.lab.streams import run_stream
from robot.lab.task import Result, Task
from robot.lab.trial import Place, Trial
from robot.types import Action, DrivenBy, Mode


def run_task(task: Task) -> Result:
    """Run one task from the start; the same task gives the same figures on every machine."""
    return RUNNERS[task.kind](task.params)


def run_lesson(params: Mapping[str, Any]) -> Result:
    """Teach, drive alone, correct, drive alone again; figures of each phase.

    Parameters: `world`, `learner`, `teacher`, `moves`, `seed`, `teach_s`, `correct_s`, `alone_s`,
    `reference_s` (how long the teacher drives once more so that its own profile is well known;
    nothing is measured of the robot after it), `delay_ms`, `names_frame`.
    """
    moves = tuple(Action(move) for move in params["moves"])
    alone_s = float(params.get("alone_s", 60.0))
    started_s = time.perf_counter()
    with Trial(
        Place(world=params["world"], seed=params["seed"]),
        make_learner(params["learner"], moves),
        make_pilot(params, moves),
    ) as trial:
        taught = trial.drive(Mode.TRAIN, params["teach_s"])
        drives = {"before": trial.drive(Mode.AUTONOMOUS, alone_s, supervised=False)}
        corrected = DriveLog()
        if params.get("correct_s"):
            corrected = trial.drive(Mode.AUTONOMOUS, params["correct_s"])
            drives["after"] = trial.drive(Mode.AUTONOMOUS, alone_s, supervised=False)
        n_nodes, lessons = trial.policy.n_nodes, dict(trial.loop.state.taught)
        again = trial.drive(Mode.TRAIN, params.get("reference_s", 240.0))
        frames = trial.frames
    seconds = time.perf_counter() - started_s
    teacher = DriveLog([*taught.moments, *again.moments])
    result: Result = {
        name: figures(drive, teacher, taught.profile(), moves) for name, drive in drives.items()
    }
    result["teacher"] = figures(again.last(alone_s), teacher, taught.profile(), moves)
    result["corrections"] = {
        "interventions_per_min": driving.interventions_per_minute(corrected),
        "pilot_share": len(corrected.driven_by(DrivenBy.PILOT)) / max(len(corrected), 1),
    }
    result["taught"] = {"agreement": driving.agreement(taught), "nodes": n_nodes}
    result["taught"]["lessons"] = {move.value: n for move, n in sorted(lessons.items())}
    result["timing"] = {"frames": frames, "frames_per_s": frames / seconds}
    return result


def figures(
    drive: DriveLog, teacher: DriveLog, taught: Profile, moves: tuple[Action, ...]
) -> dict[str, Any]:
    """Return all figures of one drive.

    Args:
        drive: The drive to measure.
        teacher: All of the teacher's driving.
        taught: The same from the minutes of teaching only, as in the paper.
        moves: The possible moves.
    """
    own = drive.profile()
    difference = compare(teacher.profile(), own, moves)
    rare = rare_moves(move_shares(teacher.actions()), move_shares(drive.actions()))
    return {
        "ssd": difference.ssd,
        "ssd_of_moves_made": difference.made,
        "ssd_frequent": sum(ssd for m, ssd in difference.per_move.items() if m not in rare),
        "ssd_against_lesson": compare(taught, own, moves).ssd,
        "ssd_per_move": {move.value: value for move, value in difference.per_move.items()},
        "never": [move.value for move in difference.never_by_robot],
        "first_collision_s": driving.first_collision_s(drive),
        "collisions_per_min": driving.collisions_per_minute(drive),
        "pushing_s_per_min": driving.pushing_s_per_minute(drive),
        **driving.figures(drive),
    }


RUNNERS: dict[str, Callable[[Mapping[str, Any]], Result]] = {
    "lesson": run_lesson,
    "simulated_footage": run_simulated_footage,
    "recorded_footage": run_recorded_footage,
    "cycles": run_cycles,
    "episodes": run_episodes,
    "habit": run_habit,
    "ready": run_ready,
    "mind": run_mind,
    "ground": run_ground,
    "stream": run_stream,
}
"""Every kind of task."""
