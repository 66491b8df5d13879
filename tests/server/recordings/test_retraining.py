"""Training again in the background: every outcome is reported."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from robot.policy.registry import make_policy
from robot.recordings.edits import Notes
from robot.recordings.store import EpisodeStore
from robot.recordings.teaching import learn_again
from robot.store.folder import Storage
from robot.store.models.model import same_nodes, take_model
from robot.testing import VirtualClock
from server.recordings.retraining import Retraining
from tests.robot.recordings.drives import record_drive


def test_retraining_gives_the_same_model_as_the_command_and_reports_a_failure(
    tmp_path: Path,
) -> None:
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
