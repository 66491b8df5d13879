"""Examples are read from a recording all at once where they have the common form."""

from __future__ import annotations

import json

import numpy as np
import pytest

from robot.policy.events import HistoryEvent, Taught, Undone, describe_event, to_json
from robot.recordings.columns import LessonTable
from robot.types import Action, Example, Point


def _taught(frame_id: int, point: Point | None = None) -> Taught:
    label = (Action.LEFT, Action.FORWARD)[frame_id % 2]
    example = Example(frame_id=frame_id, label=label, is_intervention=False, point=point)
    return Taught(example=example, x=np.zeros(0), at_s=frame_id / 10)


_POINTS = [_taught(number, Point(-0.5, 1.0)) for number in range(5)]
_PLAIN = [_taught(number) for number in range(5, 9)]


@pytest.mark.parametrize(
    "events",
    [
        [*_POINTS],
        [*_PLAIN],
        [*_PLAIN, *_POINTS],
        [*_POINTS, *_PLAIN],
        [*_POINTS, Undone(frame_ids=(3,))],
        [_taught(1, Point(1, 0))],
    ],
)
@pytest.mark.parametrize("before", [[], _PLAIN, _POINTS])
def test_examples_are_the_same_together_and_one_at_a_time(
    before: list[HistoryEvent], events: list[HistoryEvent]
) -> None:
    together, single = LessonTable(), LessonTable()
    for group in (before, events):
        texts = [to_json(describe_event(event)) for event in group]
        together.add([1.0] * len(texts), texts)
        for text in texts:
            single._add(1.0, json.loads(text))
    assert together.dump() == single.dump()
    assert len(together) == len(before) + len(events)
