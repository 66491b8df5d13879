"""Long work on recordings runs in the background, and reports results, errors and its end."""

import asyncio
import io
import os
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

import pytest

from robot.errors import NotFoundError, RecordingError
from robot.policy.registry import make_policy
from robot.recordings.archive import join_recording
from robot.recordings.editing import write_edited
from robot.recordings.edits import Notes, trim
from robot.recordings.store import EpisodeStore
from robot.recordings.teaching import learn_again
from robot.store.folder import Storage
from robot.store.models.model import same_nodes, take_model
from robot.testing import VirtualClock
from server.recordings import part, routes
from server.recordings.retraining import Retraining
from server.recordings.separate_process import SeparateWork
from tests.robot.recordings.drives import record_drive

from .work import hang, work


@pytest.mark.parametrize(
    ("ending", "error", "text"),
    [
        ("own error", NotFoundError, "no such picture"),
        ("foreign error", RuntimeError, "by a learner"),
        ("crash", RecordingError, "enough memory"),
    ],
)
def test_a_separate_process_yields_its_results_before_its_error(ending, error, text):
    told = SeparateWork(work, ending)
    assert next(told) == b"x" * 3_000_000
    assert next(told) == 19
    with pytest.raises(error, match=text):
        next(told)


def test_a_separate_process_ends_with_its_reader():
    told = SeparateWork(hang)
    pid = next(told)
    with pytest.raises(RecordingError), ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(list, told)
        told.close()
        waiting.result()
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


def test_a_long_recording_is_copied_there_byte_for_byte(tmp_path, monkeypatch):
    episode = record_drive(tmp_path, frames=30)
    notes = Notes().with_edit(trim(episode.frames, *list(episode.frames)[5:21:15]))
    here, there = io.BytesIO(), io.BytesIO()
    here.close, there.close = lambda: None, lambda: None
    write_edited(episode, notes, here)
    monkeypatch.setattr(part, "_SHORT", 20)
    part._write_edited(episode, notes, there)
    assert there.getvalue() == here.getvalue() != b""
    joined, expected = bytearray(), bytearray()

    async def download() -> None:
        async for block in routes._sent_separately(episode.path):
            joined.extend(block)

    asyncio.run(download())
    join_recording(expected.extend, episode.path)
    assert joined == expected != b""


def test_retraining_gives_the_same_model_as_the_command_and_reports_a_failure(tmp_path):
    store = EpisodeStore(Storage(tmp_path))
    episode = record_drive(tmp_path / "episodes", frames=60)
    clock = VirtualClock()
    run = Retraining(clock)
    run.begin(store, [episode.id], "published-8")
    clock.sleep(60.0)
    found, expected = run.describe(), make_policy("published-8", episode.moves)
    report = learn_again(expected, [(episode, Notes())])
    assert (found["state"], found["taught"]) == ("done", report.taught)
    assert found["comparison"]["frames"] > 0
    expected_model = take_model(expected, Counter(), saved_at_s=0.0)
    assert same_nodes(run.take().state, expected_model.state)
    run.drop()
    run.begin(store, [episode.id], "published-8")
    run.drop()
    assert run.describe() == {"state": "idle"}
    run.begin(store, [episode.id], "nobody-8")
    clock.sleep(60.0)
    found = run.describe()
    assert found["state"] == "failed"
    assert found["error"].startswith("unknown learner 'nobody-8'")
