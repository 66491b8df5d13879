#!/bin/sh
# skl2onnx 1.20.0 (scikit-learn 1.9.1, onnxruntime 1.32.0): exported nearest neighbours ignore weights="distance".
#
# Guess before running: the exported KNeighborsRegressor and KNeighborsClassifier with weights="distance" predict what
# scikit-learn predicts. A learned example gets its own target, although its distance is 0.
# Outcome: wrong. Each of the k neighbours has the same weight, as with weights="uniform", and no error is raised. In
# the graph the distances are multiplied by -1 and then limited to at least 1e-6, so all weights are equal. For an
# example with the steering -0.8, the prediction is the mean of this steering and its neighbours'. With
# weights="uniform" or a single neighbour the export is right.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --no-compile --disable-pip-version-check \
    skl2onnx==1.20.0 scikit-learn==1.9.1 onnxruntime==1.32.0 numpy==2.4.6
"$folder/env/bin/python" -W ignore - <<'PY'
import numpy as np
import onnxruntime
from skl2onnx import to_onnx
from sklearn.neighbors import KNeighborsClassifier, KNeighborsRegressor

rng = np.random.default_rng(0)
learned = rng.random((50, 4), dtype=np.float32)
steering = rng.uniform(-1, 1, 50).astype(np.float32)


def exported(model) -> np.ndarray:
    graph = to_onnx(model, learned[:1]).SerializeToString()
    session = onnxruntime.InferenceSession(graph, providers=["CPUExecutionProvider"])
    return np.ravel(session.run(None, {"X": learned})[0])


found = {}
for weights, k in (("uniform", 3), ("distance", 1), ("distance", 3)):
    regressor = KNeighborsRegressor(k, weights=weights).fit(learned, steering)
    classifier = KNeighborsClassifier(k, weights=weights).fit(learned, steering > 0)
    largest_error = float(np.abs(exported(regressor) - regressor.predict(learned)).max())
    agreement = float((exported(classifier) == classifier.predict(learned)).mean())
    found[weights, k] = largest_error, agreement
    print(f"{weights}, {k} neighbours: largest error {largest_error:.2f}, same class {agreement:.0%}")
for error, agreement in (found["uniform", 3], found["distance", 1]):
    assert error < 1e-6 and agreement == 1.0
assert found["distance", 3][0] > 0.5 and found["distance", 3][1] < 0.9
by_distance = KNeighborsRegressor(3, weights="distance").fit(learned, steering)
uniform = KNeighborsRegressor(3).fit(learned, steering)
assert np.abs(by_distance.predict(learned) - steering).max() == 0.0
assert np.allclose(exported(by_distance), uniform.predict(learned), atol=1e-6)
PY
