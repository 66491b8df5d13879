"""One pilot who changes his mind: a minute of LEFT at walls, then RIGHT for half a minute, twice.

After each half minute the new pilot drives on for a while without the robot's learning, and it is
counted what the robot would have done where he turns.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robot.clock import ManualClock
from robot.devices.simulation.camera import SimCamera, SimCameraOptions
from robot.devices.simulation.driver import SimDriver, SimOptions
from robot.lab.habit_run import make_habit_pilot
from robot.lab.ideas import make_learner
from robot.lab.simulated_pilots.habits import HABITS
from robot.lab.simulated_pilots.situation import Situation
from robot.lab.simulated_pilots.teachers import TEACHER_PARAMS
from robot.lab.task import Result
from robot.lab.trial import Place, Trial, drive_by_hand
from robot.policy.policy import Policy
from robot.types import Action, Mode

BLOCKED_M = TEACHER_PARAMS["usual"].turn_at_m
"""Views with less free way than this are those in question: both pilots turn there."""
LOOKS_HZ = 10.0
_MOVES = (Action.FORWARD, Action.LEFT, Action.RIGHT)


def run_mind(params: Mapping[str, Any]) -> Result:
    """Teach LEFT, then RIGHT twice; ask after each; then let it drive alone.

    Parameters: `world`, `learner`, `seed`, `rate_hz`, `old_s`, `new_s`, `asked_s`, `alone_s`.
    """
    place, seed = Place(world=params["world"], seed=params["seed"]), params["seed"]
    old, new = (make_habit_pilot(HABITS[side], f"{side} {seed}") for side in ("left", "right"))
    policy = make_learner(params["learner"], _MOVES)
    result: Result = {}
    with Trial(place, policy, old, rate_hz=params["rate_hz"]) as trial:
        if params["old_s"]:
            trial.drive(Mode.TRAIN, params["old_s"])
        trial.pilot = new
        for name in ("first", "second"):
            trial.drive(Mode.TRAIN, params["new_s"])
            result[name] = ask(policy, params["world"], seed, params["asked_s"])
        alone = trial.drive(Mode.AUTONOMOUS, params["alone_s"], supervised=False)
    turns = [action for action in alone.actions() if action in (Action.LEFT, Action.RIGHT)]
    result["alone"] = {"turns": len(turns), "right": turns.count(Action.RIGHT)}
    return result


def ask(policy: Policy, world: str, seed: int, seconds: float) -> dict[str, int]:
    """Return what the policy would do where the new pilot turns; it learns nothing.

    Returns:
        `blocked`: how many of the views on which the pilot turns RIGHT have no way ahead; `right`
        and `left`: how often the policy would turn to that side there; `turning` and
        `turning_right`: the same over all views on which the pilot turns.
    """
    policy.reset()
    clock = ManualClock()
    driver = SimDriver(SimOptions(world=world, seed=seed + 1000))
    camera = SimCamera(driver, SimCameraOptions(), clock)
    pilot = make_habit_pilot(HABITS["right"], f"asked {seed}")
    count = dict.fromkeys(("blocked", "right", "left", "turning", "turning_right"), 0)
    would: Action | None = None

    def propose(situation: Situation) -> Action | None:
        nonlocal would
        x = policy.extract(camera.capture())
        would = policy.propose(situation.frame_id, x, at_s=situation.at_s).action
        return would

    driver.connect()
    for situation, held in drive_by_hand(driver, pilot, clock, seconds, LOOKS_HZ, propose):
        if held is Action.RIGHT:
            count["turning"] += 1
            count["turning_right"] += would is Action.RIGHT
            if situation.free_ahead_m < BLOCKED_M:
                count["blocked"] += 1
                count["right"] += would is Action.RIGHT
                count["left"] += would is Action.LEFT
    driver.disconnect()
    driver.simulation.close()
    policy.reset()
    return count
