#!/bin/sh
# movement-primitives 0.9.1: a movement that is shown with the times of a recording is learned as a plain reach.
#
# Guess before running: DMP.imitate(T, Y) takes any times, since it is given those of all points, and learns the
# same from a piece that begins at 5 s as from one that begins at 0; or it refuses the first.
# Outcome: wrong. The phase is computed from T as it is, and after the movement's duration it is nearly over, so little
# of the shape is learned, and nothing is raised. The end is still reached, as the spring pulls there: a half circle,
# 1 m high, is driven .11 m high, through what the teacher drove around. imitate(T - T[0], Y) helps. ProMP is wrong by
# .14 instead of .02 m at the times that it was taught.
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
