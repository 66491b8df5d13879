#!/bin/sh
# gymnasium 1.4.0: MaxAndSkipObservation returns an old picture at the end of an episode.
#
# Guess before running: if an episode ends within the skipped steps, the observation is the last one of them, or the
# maximum of the last two, as usual.
# Outcome: wrong. The wrapper compares the pictures of the third and the fourth step. If the episode ends at the first
# or second step, both pictures are left over from the previous skip, and a car that has just hit the wall is shown up
# to three steps before the wall. If it ends at the third step, its picture is mixed with an older one. `reward`,
# `terminated` and `info` belong to the true end, and no error is raised.
#
# Our robots of the kind `gymnasium` show the observation of the step that ended the game.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check gymnasium==1.4.0 numpy==2.4.6
"$folder/env/bin/python" - <<'PY'
import gymnasium
import numpy as np
from gymnasium.wrappers import MaxAndSkipObservation


class Road(gymnasium.Env):
    """Each picture is a row of pixels in which the car is white."""

    observation_space = gymnasium.spaces.Box(0, 255, (16,), np.uint8)
    action_space = gymnasium.spaces.Discrete(2)

    def __init__(self, wall: int) -> None:
        self.wall = wall

    def _see(self) -> np.ndarray:
        return np.where(np.arange(16) == self.place, 255, 0).astype(np.uint8)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place = 0
        return self._see(), {}

    def step(self, action):
        self.place += 1
        return self._see(), 1.0, self.place == self.wall, False, {"place": self.place}


found = {}
for wall in (9, 10, 11, 12):
    env = MaxAndSkipObservation(Road(wall), skip=4)
    env.reset(seed=1)
    is_over = False
    while not is_over:
        picture, _, is_over, _, info = env.step(0)
    found[info["place"]] = np.flatnonzero(picture).tolist()
print("place at the end: places in the last picture", found)
assert found == {9: [7, 8], 10: [7, 8], 11: [8, 11], 12: [11, 12]}
PY
