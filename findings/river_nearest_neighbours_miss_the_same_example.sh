#!/bin/sh
# river 0.26.1: with its defaults, KNNClassifier may answer with neighbours that are far away, although it has learned
# exactly the given example many times.
#
# Guess before running: with three neighbours, a value that was learned 67 times, always as "right", is "right".
# Outcome: wrong in many models. The default engine, SWINN, searches a graph. The graph may fall apart if the examples
# lie in a few dense groups, like the pictures of a robot that always drives the same lap. Then the engine returns the
# nearest examples of the wrong part, with a probability of 1. The next query, from another random start, may be
# right. With engine=LazySearch(...) all answers are right.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check river==0.26.1
"$folder/env/bin/python" - <<'EOF'
from river.neighbors import SWINN, KNNClassifier, LazySearch

GROUPS = {"left": 0.1, "ahead": 0.5, "right": 0.9}


def wrong(engine: object) -> int:
    model = KNNClassifier(n_neighbors=3, engine=engine)
    for number in range(200):
        for move, value in GROUPS.items():
            model.learn_one({"value": value + 0.01 * (number % 3)}, move)
    return sum(model.predict_one({"value": value}) != move for move, value in GROUPS.items())


default = KNNClassifier(n_neighbors=3).engine
usual = [wrong(SWINN(seed=seed)) for seed in range(12)]
lazy = wrong(LazySearch(window_size=1000))
print(f"default {type(default).__name__}: wrong answers of 3 in 12 models {usual}; LazySearch: {lazy}")
assert isinstance(default, SWINN) and sum(usual) > 6 and lazy == 0
EOF
