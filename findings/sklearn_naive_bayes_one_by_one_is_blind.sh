#!/bin/sh
# scikit-learn 1.9.1: GaussianNB that learns its examples one by one always answers the first class if one feature is
# constant.
#
# Guess before running: partial_fit with one example at a time gives the same model as fit with all examples, except
# for rounding, because means and variances can be updated exactly.
# Outcome: wrong. The variances get a small addition, which is a share of the largest variance within the last call's
# examples, and a single example has no variance. A constant feature, such as a pixel that is always white, then has a
# variance of 0. The probabilities are NaN, and predict returns classes_[0] for each example, with only warnings. fit,
# and partial_fit with the same examples in pairs, classify all of them correctly.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check scikit-learn==1.9.1 numpy==2.4.6
"$folder/env/bin/python" -W ignore - <<'EOF'
import numpy as np
from sklearn.naive_bayes import GaussianNB

random = np.random.default_rng(0)
pictures = np.vstack([random.normal(0.3, 0.1, (30, 5)), random.normal(0.7, 0.1, (30, 5))])
pictures[:, 4] = 1.0
moves = np.repeat(["left", "right"], 30)
order = random.permutation(60)
pictures, moves = pictures[order], moves[order]


def taught(by: int) -> GaussianNB:
    model = GaussianNB()
    for begin in range(0, 60, by):
        part = slice(begin, begin + by)
        model.partial_fit(pictures[part], moves[part], classes=["left", "right"])
    return model


found = {by: sorted(map(str, set(taught(by).predict(pictures)))) for by in (60, 2, 1)}
right = {by: float(taught(by).score(pictures, moves)) for by in found}
print(found, right)
assert right == {60: 1.0, 2: 1.0, 1: 0.5} and found[1] == ["left"]
assert np.isnan(taught(1).predict_proba(pictures)).all()
EOF
