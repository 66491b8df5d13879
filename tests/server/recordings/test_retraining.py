"""Training again in the background: every outcome is reported."""

from __future__ import annotations

from pathlib import Path

import pytest

from robot.policy.policy import Policy
from robot.recordings.store import EpisodeStore
from robot.store.folder import Storage
from robot.testing import VirtualClock
from server.recordings.retraining import Retraining
from tests.robot.recordings.drives import record_drive


def test_a_learner_that_fails_in_its_own_way_is_a_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = EpisodeStore(Storage(tmp_path))
    episode = record_drive(tmp_path / "episodes", frames=20)

    def extract(self: Policy, frame: object) -> object:
        raise AttributeError("no such picture")

    monkeypatch.setattr(Policy, "extract", extract)
    clock = VirtualClock()
    run = Retraining(clock)
    run.begin(store, [episode.id], "published-8")
    clock.sleep(60.0)
    found = run.describe()
    assert (found["state"], found["error"]) == ("failed", "no such picture")
