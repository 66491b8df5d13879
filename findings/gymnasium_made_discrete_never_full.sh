#!/bin/sh
# gymnasium 1.4.0: an environment whose steering was made discrete never steers fully, and its middle action does not
# drive exactly straight.
#
# Guess before running: DiscretizeAction with three bins over -1..1 gives -1, 0 and 1, that is left, straight and
# right. With two bins for a throttle of 0..1 it gives 0 and 1.
# Outcome: wrong. It gives the centres of the bins: -2/3, about 3e-8 and 2/3, and 0.25 and 0.75 for the throttle. The
# car never turns as sharply as it can, and has no action for standing still.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet gymnasium==1.4.0
"$folder/env/bin/python" - <<'EOF'
import gymnasium
import numpy as np
from gymnasium.spaces import Box
from gymnasium.wrappers import DiscretizeAction


class Car(gymnasium.Env):
    observation_space = Box(0, 1, (1,), np.float32)

    def __init__(self, low: list[float]) -> None:
        self.action_space = Box(np.array(low, np.float32), np.ones(len(low), np.float32))
        self.taken: list[list[float]] = []

    def reset(self, *, seed: int | None = None, options: dict | None = None):
        return np.zeros(1, np.float32), {}

    def step(self, action: np.ndarray):
        self.taken.append([float(value) for value in action])
        return np.zeros(1, np.float32), 0.0, False, False, {}


def taken(low: list[float], bins: object) -> list[list[float]]:
    car = Car(low)
    discrete = DiscretizeAction(car, bins)
    discrete.reset()
    for action in range(int(discrete.action_space.n)):
        discrete.step(action)
    return car.taken


steering = [value for [value] in taken([-1], 3)]
throttle = sorted({values[1] for values in taken([-1, 0], (3, 2))})
print(steering, throttle)
assert [round(value, 3) for value in steering] == [-0.667, 0.0, 0.667] and steering[1] != 0
assert throttle == [0.25, 0.75]
EOF
