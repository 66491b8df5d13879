#!/bin/sh
# ruckig 0.19.4 (PyPI): a robot that must drive slower drives backward for a moment.
#
# Guess before running: if max_velocity falls from 0.3 to 0.05 m/s in the middle of a way, because a person comes near,
# the robot slows down to 0.05 m/s and goes on with it.
# Outcome: wrong. The speed falls through 0.05 and 0 to -0.05 m/s, although the target lies 0.8 m ahead: the braking is
# not ended before the new limit, and with limited jerk the speed then falls further, by a**2 / (2 * jerk). The result
# is "Working" all the time. With a tenfold max_jerk, the robot does not drive back.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --no-compile --disable-pip-version-check ruckig==0.19.4
"$folder/env/bin/python" - <<'PY'
from ruckig import InputParameter, OutputParameter, Result, Ruckig

STEP_S = 0.05


def slowed(jerk: float) -> tuple[float, list[float]]:
    """Return the way to the target when the limit falls, and the speeds of the next second."""
    planner, wanted, planned = Ruckig(1, STEP_S), InputParameter(1), OutputParameter(1)
    wanted.current_position, wanted.target_position = [0.0], [1.5]
    wanted.max_velocity, wanted.max_acceleration, wanted.max_jerk = [0.3], [1.0], [jerk]
    speeds = []
    for step in range(70):
        if step == 50:
            wanted.max_velocity, left = [0.05], 1.5 - wanted.current_position[0]
        assert planner.update(wanted, planned) is Result.Working
        planned.pass_to_input(wanted)
        speeds.append(planned.new_velocity[0])
    return left, speeds[50:]


left, speeds = slowed(5.0)
print(f"{left:.2f} m before the target:", [round(speed, 3) for speed in speeds])
_, quick = slowed(50.0)
print("with a tenfold jerk:", [round(speed, 3) for speed in quick])
assert left > 0.5 and min(speeds) < -0.04
assert min(quick) > 0.0
PY
