#!/bin/sh
# gymnasium 1.4.0: a person's play is recorded with a wrong first observation, and each game begins in the same place.
#
# Guess before running: play() gives its callback the observations before and after each step, both from the
# observation space, even at an episode's first step. With a seed the first episode is repeatable, and the others
# begin in other places, as after reset() without a seed.
# Outcome: wrong. At the first step of each episode, `obs_t` is the whole result of reset(): the pair of an
# observation and `info`. The seed is passed to each reset, so all demonstrations begin in one place: the three games
# of this script have one beginning, but three without a seed. PlayPlot passes the pair on, too.
#
# Our robots of the kind `gymnasium` give each episode another seed: the number in the options plus the episode's
# number.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check gymnasium==1.4.0 numpy==2.4.6 pygame==2.6.1
SDL_VIDEODRIVER=dummy PYGAME_HIDE_SUPPORT_PROMPT=1 "$folder/env/bin/python" -W ignore - <<'PY'
import gymnasium
import numpy as np
import pygame
from gymnasium.utils.play import play


class Road(gymnasium.Env):
    """The observation is the car's place; a game lasts three steps."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 500}
    render_mode = "rgb_array"
    observation_space = gymnasium.spaces.Box(0, 1, (1,), np.float32)
    action_space = gymnasium.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.steps = 0
        return self._see(), {"lap": 1}

    def step(self, action):
        self.steps += 1
        return self._see(), 0.0, self.steps == 3, False, {}

    def _see(self):
        return self.np_random.random(1, np.float32)

    def render(self):
        return np.zeros((20, 20, 3), np.uint8)


def record(seed):
    seen = []

    def keep(obs_t, obs_tp1, action, reward, terminated, truncated, info):
        seen.append(obs_t)
        if len(seen) == 9:
            pygame.event.post(pygame.event.Event(pygame.QUIT))

    play(Road(), callback=keep, keys_to_action={"a": 1}, noop=0, seed=seed)
    return seen[:9]


found = {seed: record(seed) for seed in (7, None)}
kinds = [type(one).__name__ for one in found[7]]
beginnings = {seed: len({float(one[0][0]) for one in seen[::3]}) for seed, seen in found.items()}
print(kinds, "different beginnings of three games:", beginnings)
assert kinds == ["tuple", "ndarray", "ndarray"] * 3
assert found[7][0][1] == {"lap": 1} and beginnings == {7: 1, None: 3}
PY
