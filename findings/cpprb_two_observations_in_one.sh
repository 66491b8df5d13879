#!/bin/sh
# cpprb 11.0.0 (PyPI): a replay buffer takes an observation of the wrong size apart, and rounds and wraps its numbers.
#
# Guess before running: a buffer of observations with two bytes raises an error for an observation with four numbers, for
# a number above 255, and for a fraction.
# Outcome: wrong in all three. Four numbers become two observations, so the buffer grows by two. 300 becomes 44, -1
# becomes 255, and 7.9 becomes 7, all without an error. Only if each step has a second value, such as an action, the
# observation of the wrong size is refused.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --no-compile --disable-pip-version-check cpprb==11.0.0 numpy==2.4.6
"$folder/env/bin/python" - <<'PY'
import numpy as np
from cpprb import ReplayBuffer

buffer = ReplayBuffer(8, {"obs": {"shape": (2,), "dtype": np.uint8}})
for observation in ([300, -1], [7.9, 0.0], [1, 2, 3, 4]):
    buffer.add(obs=observation)
    print(f"{observation}: {buffer.get_stored_size()} stored")
found = buffer.get_all_transitions()["obs"].tolist()
print(found)
assert found == [[44, 255], [7, 0], [1, 2], [3, 4]]

buffer = ReplayBuffer(8, {"obs": {"shape": (2,), "dtype": np.uint8}, "act": {}})
try:
    buffer.add(obs=[1, 2, 3, 4], act=1)
except ValueError as error:
    print(f"with an action: {error}")
else:
    raise AssertionError("taken")
PY
