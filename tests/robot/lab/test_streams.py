"""Streams beyond driving come from inside the libraries, and BSOC learns them."""

from __future__ import annotations

from types import ModuleType

import pytest

pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.fixture(scope="module")
def streams() -> ModuleType:
    """Import the libraries only in the worker that runs these tests; it takes two seconds."""
    for library in ("sklearn", "river"):
        pytest.importorskip(library, reason="NOT TESTED: the extra learners is not installed")
    return pytest.importorskip("robot.lab.streams")


@pytest.mark.parametrize(
    ("stream", "classes"), [("digits", 10), ("image segments", 7), ("text", 3)]
)
def test_a_stream_is_whole_and_the_same_each_time(
    streams: ModuleType, stream: str, classes: int
) -> None:
    examples = streams.read_stream(stream)
    assert len(examples) > 1000
    assert len({label for _, label in examples}) == classes
    assert len({x.shape for x, _ in examples}) == 1
    again = streams.read_stream(stream)
    assert all((x == y).all() for (x, _), (y, _) in zip(examples, again, strict=True))


def test_bsoc_learns_digits_as_they_come(streams: ModuleType) -> None:
    result = streams.run_stream({"stream": "digits", "learner": "BSOC-128", "seed": 1})
    assert result == streams.run_stream({"stream": "digits", "learner": "BSOC-128", "seed": 1})
    assert result["right"] > 0.88 * result["examples"]
