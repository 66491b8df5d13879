#!/bin/sh
# filterpy 2.0.0 (numpy 2.4.6, scipy 1.17.1): an unscented Kalman filter that is corrected twice in one step is wrong.
#
# Guess before running: a robot that sees three beacons at once calls predict() once and update() three times, as with
# KalmanFilter. If everything is linear, the unscented filter then has the same position and variance.
# Outcome: wrong from the second update() on. It compares the second beacon with the points that predict() made, so it
# ignores the first correction and adds the difference again. From 0 m, three measurements of 5 m lead to 11.9 m
# instead of 4.6 m, and the variance becomes negative. No error is raised. With one beacon in each step, as in most
# tests, both filters agree. They also agree if all measurements are in one vector, or if new points are made before
# each further update().
#
# Our learners and robots use no Kalman filter.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check --no-deps filterpy==2.0.0 numpy==2.4.6 scipy==1.17.1
"$folder/env/bin/python" - <<'PY'
import numpy as np
from filterpy.kalman import KalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter

STEP_S, MEASURED_M, BEACONS = 0.1, 5.0, 3
moved = np.array([[1.0, STEP_S], [0.0, 1.0]])


def unscented(beacons: int) -> UnscentedKalmanFilter:
    made = UnscentedKalmanFilter(
        dim_x=2,
        dim_z=beacons,
        dt=STEP_S,
        hx=lambda state: np.full(beacons, state[0]),
        fx=lambda state, _: moved @ state,
        points=MerweScaledSigmaPoints(2, alpha=0.1, beta=2.0, kappa=1.0),
    )
    made.x = np.array([0.0, 1.0])
    return begun(made, beacons)


def begun(made, beacons: int):
    made.P, made.Q, made.R = np.diag([4.0, 1.0]), 0.01 * np.eye(2), np.eye(beacons)
    made.predict()
    return made


linear = KalmanFilter(dim_x=2, dim_z=1)
linear.x, linear.F, linear.H = np.array([[0.0], [1.0]]), moved, np.array([[1.0, 0.0]])
begun(linear, 1)
plain, spread_anew, stacked = unscented(1), unscented(1), unscented(BEACONS)
for beacon in range(BEACONS):
    linear.update(np.array([[MEASURED_M]]))
    plain.update(np.array([MEASURED_M]))
    spread_anew.update(np.array([MEASURED_M]))
    spread_anew.sigmas_f = spread_anew.points_fn.sigma_points(spread_anew.x, spread_anew.P)
    if beacon == 0:
        assert np.allclose(plain.x, linear.x.ravel()) and np.allclose(plain.P, linear.P)
stacked.update(np.full(BEACONS, MEASURED_M))
for name, found in (("linear", linear), ("unscented", plain), ("anew", spread_anew), ("stacked", stacked)):
    print(f"{name:9} position {found.x.ravel()[0]:6.2f} m, variance {found.P[0, 0]:6.2f}")
for right in (spread_anew, stacked):
    assert np.allclose(right.x, linear.x.ravel()) and np.allclose(right.P, linear.P)
assert 4.6 < linear.x[0, 0] < 4.7 and plain.x[0] > 11.8 and plain.P[0, 0] < -5.0
PY
