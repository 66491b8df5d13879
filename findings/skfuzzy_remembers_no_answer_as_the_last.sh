#!/bin/sh
# scikit-fuzzy 0.5.0: an input that no rule covers has no output the first time, and the output of another input the
# second time.
#
# Guess before running: each time that a distance between "near" and "far" is measured, which no rule covers,
# compute() raises an error, or leaves no speed in `output`.
# Outcome: wrong. The first time `output` is empty, so output["speed"] raises KeyError. But the input is marked as
# calculated, and the next compute() with it leaves `output` unchanged: the speed of the previous input. A robot whose
# program stops at the KeyError, and continues later, passes the same gap in its rules at full speed. There is no
# error or warning. With cache=False the output is missing each time.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check scikit-fuzzy==0.5.0 networkx==3.6.1 numpy==2.4.6 \
  scipy==1.17.1 packaging
"$folder/env/bin/python" - <<'PY'
import numpy as np
from skfuzzy import control, trimf

distance = control.Antecedent(np.arange(0, 101), "distance")
speed = control.Consequent(np.arange(0, 101), "speed")
distance["near"], distance["far"] = trimf(distance.universe, [0, 0, 40]), trimf(distance.universe, [60, 100, 100])
speed["slow"], speed["fast"] = trimf(speed.universe, [0, 0, 50]), trimf(speed.universe, [50, 100, 100])
pairs = (distance["near"], speed["slow"]), (distance["far"], speed["fast"])
rules = control.ControlSystem([control.Rule(*pair) for pair in pairs])


def driven(cache: bool) -> list[float | None]:
    robot, speeds = control.ControlSystemSimulation(rules, cache=cache), []
    for measured in (10, 50, 90, 50):
        robot.input["distance"] = measured
        robot.compute()
        speeds.append(round(float(robot.output["speed"]), 1) if "speed" in robot.output else None)
    return speeds


found = driven(cache=True), driven(cache=False)
print("speeds at 10, 50, 90 and 50 cm: as it comes %s, without the cache %s" % found)
assert found == ([17.5, None, 82.5, 82.5], [17.5, None, 82.5, None])
PY
