"""Lessons that a power cut kept out of the model come back from the recording, once."""

from __future__ import annotations

from pathlib import Path

import pytest

from robot.episodes.recovery import recover_last
from robot.episodes.teaching import same_nodes
from robot.models.model import Model, take_model
from robot.models.store import ModelStore
from robot.policy.history import TrainingHistory
from robot.storage.folder import Storage

from .drives import RecordedBench


@pytest.fixture
def storage(tmp_path: Path) -> Storage:
    return Storage(tmp_path)


def now(history: TrainingHistory) -> Model:
    return take_model(history.policy, history.taught, saved_at_s=1.0)


def cut(storage: Storage, robot: RecordedBench) -> None:
    """Have the newest recording end as a kill leaves it: without its last bytes."""
    path = robot.finish()[-1]
    path.write_bytes(path.read_bytes()[:-40])


@pytest.mark.parametrize("learner", ["published-8", "default-8"])
@pytest.mark.parametrize("undoes", [False, True])
def test_the_model_is_brought_up_to_the_recording(
    storage: Storage, learner: str, undoes: bool
) -> None:
    store = ModelStore(storage)
    robot = RecordedBench(storage.episodes, learner)
    history = robot.loop.history
    robot.drive(range(30))
    store.save("bench", now(history))
    store.current = "bench"
    robot.drive(range(30, 50))
    if undoes:
        robot.loop.submit(lambda: history.undo(0.4))
        robot.tick()
    live = now(history)
    cut(storage, robot)

    won = recover_last(storage.episodes, store, "bench")
    assert won == live.card.lessons - 30 > 0
    back = store.load("bench")
    assert same_nodes(back.state, live.state)
    assert back.card.taught == live.card.taught

    store.save("other", back)
    store.current = "other"
    assert recover_last(storage.episodes, store, "bench") == 0


def test_a_model_that_was_never_saved_comes_back_whole(storage: Storage) -> None:
    store = ModelStore(storage)
    robot = RecordedBench(storage.episodes)
    robot.drive(range(30))
    live = now(robot.loop.history)
    cut(storage, robot)
    (storage.episodes / "zebra.mcap").write_bytes(b"an import, which no robot recorded")
    assert recover_last(storage.episodes, store, "bench") == 30
    assert store.current == "bench"
    assert same_nodes(store.load("bench").state, live.state)


def test_a_whole_recording_changes_nothing(storage: Storage) -> None:
    store = ModelStore(storage)
    robot = RecordedBench(storage.episodes)
    robot.drive(range(30))
    robot.finish()
    assert recover_last(storage.episodes, store, "bench") == 0
    assert store.names() == []


def test_a_recording_that_nobody_can_read_stops_no_start(storage: Storage) -> None:
    (storage.episodes / "2026-01-01_120000_000.mcap").write_bytes(b"rubbish")
    assert recover_last(storage.episodes, ModelStore(storage), "bench") == 0
