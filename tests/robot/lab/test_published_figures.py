"""The figures of the published learner on real footage are reproduced."""

from __future__ import annotations

import os
import statistics
from pathlib import Path

import pytest

from robot.lab.evaluation import evaluate, load_pairs
from tests.kit.sizes import IS_FULL

FOUND = os.environ.get(
    "DRIVELESSON_RECORDINGS", str(Path(__file__).parents[3].parent / "shared/recordings")
)
FIGURES = {  # place: published BSOC-64, published BSOC-32, 9-nn
    "asphalt": (0.828, 0.807, 0.837),
    "gym": (0.813, 0.742, 0.810),
    "matroom": (0.715, 0.699, 0.776),
    "office1": (0.637, 0.643, 0.680),
    "simroad": (0.846, 0.813, 0.858),
}
LEARNERS = ["published-64", "published-32", *(["knn-9"] if IS_FULL else [])]
"""Only the full size includes kNN, which takes four times as long as the other two."""


@pytest.mark.recordings
@pytest.mark.skipif(
    not Path(FOUND).is_dir(), reason=f"no footage in {FOUND}; set DRIVELESSON_RECORDINGS"
)
@pytest.mark.parametrize("place", FIGURES if IS_FULL else ["gym"])
def test_the_published_figures_of_the_recordings_are_reproduced(place: str) -> None:
    pairs = [pair for pair in load_pairs(FOUND) if pair.place == place]
    results = list(evaluate(pairs, LEARNERS))
    for learner, figure in zip(LEARNERS, FIGURES[place], strict=False):
        accuracies = [r["accuracy"] for r in results if r["learner"] == learner]
        assert len(accuracies) == 2, "one figure for each direction of the recordings"
        assert statistics.mean(accuracies) == pytest.approx(figure, abs=0.015), learner
