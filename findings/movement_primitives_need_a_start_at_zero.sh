#!/bin/sh
# movement-primitives 0.9.1: a movement with the times of a recording is learned as a plain reach to its end.
#
# Guess before running: DMP.imitate(T, Y) accepts any times, since it gets the times of all points. It learns the same
# from a movement that begins at 5 s as from one that begins at 0, or it refuses the first.
# Outcome: wrong. The phase is computed from T without a shift, and after the movement's duration it is nearly over.
# Little of the shape is therefore learned, and no error is raised. The end is still reached, because the spring pulls
# towards it. A half circle that is 1 m high is driven with a height of 0.11 m, through the obstacle that the teacher
# drove around. imitate(T - T[0], Y) helps. At the taught times, ProMP is wrong by 0.14 m instead of 0.02 m.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check movement-primitives==0.9.1 pytransform3d==3.17.0 \
  numpy==2.4.6 scipy==1.17.1
"$folder/env/bin/python" - <<'PY'
import numpy as np
from movement_primitives.dmp import DMP
from movement_primitives.promp import ProMP

times_s = np.linspace(0, 1, 101)
circle = np.stack([-np.cos(np.pi * times_s), np.sin(np.pi * times_s)], axis=1)  # m


def driven(begin_s: float) -> np.ndarray:
    movement = DMP(n_dims=2, execution_time=1.0, dt=0.01, n_weights_per_dim=30)
    movement.imitate(times_s + begin_s, circle)
    movement.configure(start_y=circle[0], goal_y=circle[-1])
    return movement.open_loop()[1]


def mean(begin_s: float) -> np.ndarray:
    movement = ProMP(n_dims=2, n_weights_per_dim=10)
    movement.imitate(np.stack([times_s + begin_s] * 2), np.stack([circle, circle + 0.01]))
    return movement.mean_trajectory(times_s + begin_s)


found = {}
for begin_s in (0.0, 5.0):
    path = driven(begin_s)
    errors = float(np.abs(path[-1] - circle[-1]).max()), float(np.abs(mean(begin_s) - circle).max())
    found[begin_s] = float(path[:, 1].max()), *errors
print("begin: height of the half circle (1 m), error at the end, largest error of a ProMP", found)
assert found[0.0][0] > 0.9 and found[5.0][0] < 0.2
assert found[0.0][1] < 0.02 and found[5.0][1] < 0.02
assert found[0.0][2] < 0.03 and found[5.0][2] > 0.1
PY
