#!/bin/sh
# gymnasium 1.4.0, minari 0.5.4: classes that store observations keep only the last one, if an environment returns the
# same array each time.
#
# Guess before running: wrappers and recorders copy the observations that they store, as MaxAndSkipObservation and the
# vector environments do, because a simulator or a camera often fills one array again and again.
# Outcome: wrong. FrameStackObservation returns the newest picture three times, so a learner sees no motion.
# DelayObservation does not delay. The final_obs of vector environments, even of those in other processes, is the
# first picture of the next game. An episode that Minari records has the last picture in each row. Shapes and numbers
# of rows are right.
#
# Our robots of the kind `gymnasium` copy or compress each picture before the next step.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check gymnasium==1.4.0 \
  'minari[hdf5,create]==0.5.4' numpy==2.4.6 pillow==13.0.0
cd "$folder"
cat > road.py <<'PY'
import gymnasium
import numpy as np


class Road(gymnasium.Env):
    """In picture 12 of the first game all pixels are 12; the second game begins with 20."""

    observation_space = gymnasium.spaces.Box(0, 255, (2,), np.uint8)
    action_space = gymnasium.spaces.Discrete(2)

    def __init__(self, copies: bool, length: int = 3) -> None:
        self.copies, self.length, self.game, self.pixels = copies, length, 0, np.zeros(2, np.uint8)

    def _see(self) -> np.ndarray:
        self.pixels[:] = 10 * self.game + self.place
        return self.pixels.copy() if self.copies else self.pixels

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place, self.game = 0, self.game + 1
        return self._see(), {}

    def step(self, action):
        self.place += 1
        return self._see(), 1.0, self.place == self.length, False, {}
PY
MINARI_DATASETS_PATH="$folder/datasets" "$folder/env/bin/python" -W ignore - <<'PY'
import gymnasium
import minari
import numpy as np
from gymnasium.vector import AsyncVectorEnv, AutoresetMode
from gymnasium.wrappers import DelayObservation, FrameStackObservation
from road import Road

gymnasium.register("Road-v0", entry_point="road:Road")


def three_steps(env: gymnasium.Env) -> list:
    seen = [env.reset()[0].copy(), *(env.step(0)[0].copy() for _ in range(3))]
    return [picture[..., 0].tolist() for picture in seen]


def final(copies: bool) -> int:
    env = AsyncVectorEnv([lambda: Road(copies)], autoreset_mode=AutoresetMode.SAME_STEP)
    env.reset()
    *_, info = [env.step(np.zeros(1, int)) for _ in range(3)][-1]
    env.close()
    return int(info["final_obs"][0][0])


def recorded(copies: bool) -> list[list[int]]:
    env = minari.DataCollector(gymnasium.make("Road-v0", copies=copies))
    for _ in range(2):
        env.reset()
        for _ in range(3):
            env.step(0)
    dataset = env.create_dataset(f"road/copies{int(copies)}-v0")
    return [episode.observations[:, 0].tolist() for episode in dataset.iterate_episodes()]


found = {}
for copies in (True, False):
    stacked = three_steps(FrameStackObservation(Road(copies), 3))
    delayed = three_steps(DelayObservation(Road(copies), 1))
    found[copies] = stacked, delayed, final(copies), recorded(copies)
    print("copies" if copies else "reuses", *found[copies])
assert found[True][0] == [[10, 10, 10], [10, 10, 11], [10, 11, 12], [11, 12, 13]]
assert found[False][0] == [[10, 10, 10], [11, 11, 11], [12, 12, 12], [13, 13, 13]]
assert found[True][1:3] == ([0, 10, 11, 12], 13) and found[False][1:3] == ([0, 11, 12, 13], 20)
assert found[True][3] == [[10, 11, 12, 13], [20, 21, 22, 23]]
assert found[False][3] == [[13] * 4, [23] * 4]
PY
