#!/bin/sh
# opencv-python-headless 5.0.0.93 (x86-64): BackgroundSubtractorKNN learns fastest with a learning rate of 0, which is
# documented as "not updated at all".
#
# Guess before running: after 50 pictures of an empty floor, apply(picture, learningRate=0) reports a thing that is
# put on the floor in each of 600 pictures, as BackgroundSubtractorMOG2 does.
# Outcome: wrong. The thing becomes part of the floor after 5 pictures. That takes 27 pictures at the automatic rate,
# and 22 at a rate of 0.01. The number of pictures between two updates is computed from log(0.7) / log(1 - rate),
# which divides by zero, and the result is negative. A rate of 1e-6 keeps the background. A robot that learns the
# floor while nobody is there, and then stops learning, therefore sees nobody.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check opencv-python-headless==5.0.0.93 numpy==2.4.6
"$folder/env/bin/python" - <<'PY'
import cv2
import numpy as np

floor = np.random.default_rng(0).integers(0, 256, (60, 80, 3), dtype=np.uint8)
thing = floor.copy()
thing[20:40, 20:40] = 255 - thing[20:40, 20:40]


def seen_for(make: object, rate: float) -> int:
    """Return the number of pictures of 600 in which most of the thing is reported."""
    subtractor = make(detectShadows=False)
    for _ in range(50):
        subtractor.apply(floor)
    return sum(bool((subtractor.apply(thing, learningRate=rate)[20:40, 20:40] == 255).mean() > 0.5) for _ in range(600))


rates = 0, 1e-6, 0.01, -1
knn = {rate: seen_for(cv2.createBackgroundSubtractorKNN, rate) for rate in rates}
mog2 = {rate: seen_for(cv2.createBackgroundSubtractorMOG2, rate) for rate in rates}
print("pictures in which the thing is seen: KNN", knn, "MOG2", mog2)
assert knn[1e-6] == mog2[0] == mog2[1e-6] == 600
assert knn[0] < 10 < knn[0.01] < 100 and 10 < knn[-1] < 100
PY
