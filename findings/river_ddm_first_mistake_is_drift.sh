#!/bin/sh
# river 0.26.1: the drift detector DDM reports a drift at the first mistake of a good model, however long it was
# right.
#
# Guess before running: after 1000 right answers, a single wrong one is neither a drift nor a warning.
# Outcome: wrong. The detector compares the error rate with the lowest rate so far, plus three standard deviations. If
# at least the first 31 answers are right, both are zero, so any error rate is above them. A program that restarts its
# learner at a drift, as is usual, then forgets everything because of one wrong answer in a thousand. In 10,000
# answers, a model with a constant rate of one mistake in 1000 has eight alarms, while worse models, with one mistake
# in 100, 20 or 10, have none. ADWIN, HDDM-A and HDDM-W raise no alarm for the same answers.
#
# Our learners use no drift detector.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check river==0.26.1
"$folder/env/bin/python" - <<'PY'
import random

from river.drift import ADWIN
from river.drift.binary import DDM, HDDMA, HDDMW


def alarms(detector: object, mistakes: list[int]) -> list[int]:
    found = []
    for place, is_wrong in enumerate(mistakes):
        detector.update(is_wrong)
        if detector.drift_detected:
            found.append(place)
    return found


once = [0] * 1000 + [1] + [0] * 1000
after_one = {kind.__name__: alarms(kind(), once) for kind in (DDM, HDDMA, HDDMW, ADWIN)}
counts = {}
for rate in (0.001, 0.01, 0.05, 0.1):
    chance = random.Random(1)
    mistakes = [int(chance.random() < rate) for _ in range(10_000)]
    counts[rate] = [len(alarms(kind(), mistakes)) for kind in (DDM, HDDMA, HDDMW, ADWIN)]
print("one mistake:", after_one, "alarms by error rate:", counts)
assert after_one == {"DDM": [1000], "HDDMA": [], "HDDMW": [], "ADWIN": []}
assert {rate: found[0] for rate, found in counts.items()} == {0.001: 8, 0.01: 0, 0.05: 0, 0.1: 0}
assert not any(any(found[1:]) for found in counts.values())
PY
