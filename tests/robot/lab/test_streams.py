"""Streams beyond driving come from inside the libraries, and BSOC learns them."""

from __future__ import annotations

import pytest

pytest.importorskip("sklearn", reason="NOT TESTED: the extra learners is not installed")
pytest.importorskip("river", reason="NOT TESTED: the extra learners is not installed")

from robot.lab.streams import read_stream, run_stream

pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.mark.parametrize(
    ("stream", "classes"), [("digits", 10), ("image segments", 7), ("text", 3)]
)
def test_a_stream_is_whole_and_the_same_each_time(stream: str, classes: int) -> None:
    examples = read_stream(stream)
    assert len(examples) > 1000
    assert len({label for _, label in examples}) == classes
    assert len({x.shape for x, _ in examples}) == 1
    again = read_stream(stream)
    assert all((x == y).all() for (x, _), (y, _) in zip(examples, again, strict=True))


def test_bsoc_learns_digits_as_they_come() -> None:
    result = run_stream({"stream": "digits", "learner": "BSOC-128", "seed": 1})
    assert result == run_stream({"stream": "digits", "learner": "BSOC-128", "seed": 1})
    assert result["right"] > 0.88 * result["examples"]
