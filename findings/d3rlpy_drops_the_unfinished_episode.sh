#!/bin/sh
# d3rlpy 2.8.1: the steps after the last marked end of an episode are dropped from a dataset.
#
# Guess before running: MDPDataset keeps all steps, and its last step ends an episode even if it is not marked as an
# end. Or it refuses such a recording, as it refuses one without any end.
# Outcome: wrong. Episodes are cut at the marks, and the steps after the last mark belong to no episode. Of a drive of
# 25 steps with a crash at the tenth, 15 steps are missing, and no error is raised. A recording usually stops in the
# middle of a drive, so the newest steps are not learned. timeouts=, with a mark at the last step, keeps all steps.
#
# Our exporters do not write for d3rlpy.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check d3rlpy==2.8.1 torch==2.13.0 numpy==2.4.6
cd "$folder"
"$folder/env/bin/python" -W ignore - <<'PY' >said 2>&1 || { cat said; exit 1; }
import numpy as np
from d3rlpy.dataset import MDPDataset

N_STEPS = 25
pictures = np.random.default_rng(0).random((N_STEPS, 3)).astype(np.float32)
moves = np.random.default_rng(1).random((N_STEPS, 1)).astype(np.float32)
rewards = np.ones(N_STEPS, np.float32)
crashes, stops = np.zeros(N_STEPS), np.zeros(N_STEPS)


def kept(**ends: np.ndarray) -> list[int]:
    return [episode.size() for episode in MDPDataset(pictures, moves, rewards, **ends).episodes]


try:
    kept(terminals=crashes)
    is_refused = False
except AssertionError:
    is_refused = True
crashes[9] = stops[-1] = 1
found = kept(terminals=crashes), kept(terminals=crashes, timeouts=stops)
print("steps of the episodes:", *found, "without any end:", "refused" if is_refused else "kept")
assert found == ([10], [10, 15]) and is_refused
PY
tail -n 1 "$folder/said"
