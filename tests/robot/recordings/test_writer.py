"""The faster parts of the writer give the same bytes and the same columns as the slower ones."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest

from robot.policy.history import HistoryEvent, Taught, Undone
from robot.recordings import writer as writing
from robot.recordings.columns import LessonTable
from robot.recordings.messages import Topic
from robot.recordings.writer import EpisodeWriter, describe_run
from robot.store.models.events import describe_event, to_json
from robot.types import Action, Encoding, Example, Frame, Point

pytest.importorskip("mcap.writer", reason="the extra 'episodes' is not installed")
_PICTURES = 700


class _Kept(io.BytesIO):
    """A file that can be read after it was closed."""

    content = b""

    def close(self) -> None:
        self.content = self.getvalue()
        super().close()


def _taught(frame_id: int, point: Point | None = None) -> Taught:
    label = (Action.LEFT, Action.FORWARD)[frame_id % 2]
    example = Example(frame_id=frame_id, label=label, is_intervention=False, point=point)
    return Taught(example=example, x=np.zeros(0), at_s=frame_id / 10)


def _written() -> bytes:
    rng, file = np.random.default_rng(1), _Kept()
    run = describe_run(
        episode_id="a", run_id="a", origin_ns=10**18, started_at_s=0.0, moves=("left", "forward")
    )
    writer = EpisodeWriter(file, run)
    for number in range(1, _PICTURES):
        frame = Frame(
            frame_id=number,
            captured_s=number / 10 - 0.3 * (number % 50 == 0),
            width=160,
            height=120,
            encoding=Encoding.JPEG,
            data=rng.bytes(3000),
        )
        writer.write_frame(frame)
        writer.write_message(Topic.COMMAND, frame.captured_s, {"held": "left"})
        writer.write_lesson(frame.captured_s, _taught(number))
        if number % 300 == 0:
            writer.flush()
    writer.close({})
    return file.content


def test_a_file_has_the_bytes_that_the_library_writes(monkeypatch: pytest.MonkeyPatch) -> None:
    ours = _written()
    monkeypatch.setattr(writing, "_CHUNK_BUILDER", "has_no_such_part")
    assert ours == _written()
    assert len(ours) > 2 * 2**20  # several chunks


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
