#!/bin/sh
# river 0.26.1: the rule learner AMRules raises ZeroDivisionError in a drive that is steered with keys.
#
# Guess before running: AMRules learns a steering of -1, 0 or 1 as well as any other number, like
# HoeffdingTreeRegressor, which splits by the same criterion.
# Outcome: wrong. A rule looks for a split after every 200 examples that it covers. If all of these had the same
# target, their variance is 0, and the criterion divides by it. learn_one() therefore raises an error at the 200th
# example of a straight drive. In a drive with three commands it does so as soon as a rule has isolated one of them,
# in this script at the 1161st example. Each further example for this rule raises the error again. The same steering
# with a little noise is learned without an error.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check river==0.26.1
"$folder/env/bin/python" - <<'PY'
import random
from collections.abc import Callable

from river import base, rules, tree


def teach(model: base.Regressor, steer: Callable[[float, random.Random], float]) -> object:
    generator = random.Random(0)
    for number in range(1, 3001):
        line = generator.uniform(-1, 1)
        view = {"line": line, "light": generator.random()}
        try:
            model.learn_one(view, steer(line, generator))
        except ZeroDivisionError:
            return number
    return "all"


def keys(line: float) -> float:
    return -1.0 if line > 0.3 else 1.0 if line < -0.3 else 0.0


DRIVES = {
    "straight": lambda line, generator: 0.0,
    "keys": lambda line, generator: keys(line),
    "noisy keys": lambda line, generator: keys(line) + generator.gauss(0, 0.01),
}
found = {
    model.__name__: {name: teach(model(), steer) for name, steer in DRIVES.items()}
    for model in (rules.AMRules, tree.HoeffdingTreeRegressor)
}
print("learned until example:", found)
assert found["AMRules"] == {"straight": 200, "keys": 1161, "noisy keys": "all"}
assert set(found["HoeffdingTreeRegressor"].values()) == {"all"}
PY
