#!/bin/sh
# emlearn 0.23.2 (scikit-learn 1.9.1): a decision tree for a microcontroller reads features between 0 and 1 as zeros.
#
# Guess before running: convert(tree) gives the same answers as the tree, because emlearn chooses a type in which the
# thresholds differ, or emlearn warns.
# Outcome: wrong. The default type of trees and forests is a 16-bit integer, to which features and thresholds are
# truncated. Brightnesses from 0 to 1, as scikit-learn's scalers return them, all become 0. A tree and a forest that
# are always right then always answer with one class, which is right in half of the cases. There is no warning,
# although convert() returns a model that could be compared. With dtype="float" all answers agree, and with features
# multiplied by 1000 all but one in 400.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check emlearn==0.23.2 scikit-learn==1.9.1 numpy==2.4.6 \
  'setuptools<81'
cd "$folder"
"$folder/env/bin/python" -W error::UserWarning - <<'PY'
import emlearn
import numpy as np
from sklearn.ensemble import RandomForestClassifier
from sklearn.tree import DecisionTreeClassifier

brightness = np.random.default_rng(0).random((400, 4))
moves = np.where(brightness[:, 0] + brightness[:, 1] > 1, 1, 0)  # left or right
found = {}
for model in (DecisionTreeClassifier(random_state=0), RandomForestClassifier(10, random_state=0)):
    for scale, how in ((1, {}), (1, {"dtype": "float"}), (1000, {})):
        model.fit(brightness * scale, moves)
        answers = np.asarray(emlearn.convert(model, **how).predict(brightness * scale))
        agreed = float((answers == model.predict(brightness * scale)).mean())
        found[type(model).__name__, scale, *how.values()] = round(agreed, 3), len(set(answers.tolist()))
print("answers that agree, classes among the answers", found)
for (_, scale, *dtype), (agreed, classes) in found.items():
    assert (agreed < 0.6 and classes == 1) if scale == 1 and not dtype else (agreed > 0.99 and classes == 2)
PY
