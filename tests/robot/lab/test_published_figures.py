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
FIGURES = {  # place: 9-nn, published BSOC-32, published BSOC-64
    "asphalt": (0.837, 0.807, 0.828),
    "gym": (0.810, 0.742, 0.813),
    "matroom": (0.776, 0.699, 0.715),
    "office1": (0.680, 0.643, 0.637),
    "simroad": (0.858, 0.813, 0.846),
}
LEARNERS = ["knn-9", "published-32", "published-64"]


@pytest.mark.recordings
@pytest.mark.skipif(
    not Path(FOUND).is_dir(), reason=f"no footage in {FOUND}; set DRIVELESSON_RECORDINGS"
)
@pytest.mark.parametrize("place", FIGURES if IS_FULL else ["gym"])
def test_the_published_figures_of_the_recordings_are_reproduced(place: str) -> None:
    pairs = [pair for pair in load_pairs(FOUND) if pair.place == place]
    results = list(evaluate(pairs, LEARNERS))
    for learner, figure in zip(LEARNERS, FIGURES[place], strict=True):
        accuracies = [r["accuracy"] for r in results if r["learner"] == learner]
        assert len(accuracies) == 2, "one direction after the other"
        assert statistics.mean(accuracies) == pytest.approx(figure, abs=0.015), learner
