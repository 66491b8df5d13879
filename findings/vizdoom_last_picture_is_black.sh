#!/bin/sh
# vizdoom 1.3.2 (gymnasium 1.4.0): the last observation of each episode is black, and so is its rendering.
#
# Guess before running: the observation of the step that ends an episode shows the end, as in Gymnasium's own
# environments, or repeats the last picture.
# Outcome: wrong. The engine has no state after the end, so all parts of the observation are zeros: the screen, and
# the game's variables, in which 200 rounds of ammunition become none. render() is black, too, and `info` does not
# mention it. A recording therefore has a wrong last row, and a learner gets a black picture in each episode.
#
# Our robots of the kind `gymnasium` used to show it; now they show the picture before a black end.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check vizdoom==1.3.2 gymnasium==1.4.0 numpy==2.4.6
cd "$folder"
"$folder/env/bin/python" -W ignore - <<'PY'
import gymnasium
import numpy as np
from vizdoom import gymnasium_wrapper  # registers the environments

env = gymnasium.make("VizdoomDefendLine-v1", frame_skip=4, render_mode="rgb_array")
seen, _ = env.reset(seed=1)
rows, is_over = [], False
while not is_over:
    rendered = env.render()
    rows.append((int(seen["screen"].max()), int(rendered.max()), np.asarray(seen["gamevariables"]).tolist()))
    seen, _, terminated, truncated, info = env.step(0)
    is_over = terminated or truncated
last = int(seen["screen"].max()), int(env.render().max()), np.asarray(seen["gamevariables"]).tolist()
print(f"{len(rows)} steps; brightest pixel, rendered, variables: before the end {rows[-1]}, at the end {last}, {info}")
assert min(row[0] for row in rows) > 100 and rows[-1][1] > 100 and any(rows[-1][2])
assert last[:2] == (0, 0) and not any(last[2]) and info == {}
PY
