"""A folder that version 0.2 left when it was killed: opened, replayed and taught further."""

from __future__ import annotations

import hashlib
import json
import shutil
import tarfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robot.coaching.gallery import images
from robot.policy.policy import Policy
from robot.policy.registry import make_policy
from robot.recordings.edits import Notes
from robot.recordings.episode import open_episode
from robot.recordings.store import EpisodeStore
from robot.recordings.teaching import learn_again
from robot.store.folder import Storage
from robot.store.models.replay import recover
from robot.store.models.store import ModelStore
from robot.types import Action

FILES = Path(__file__).parents[1] / "vectors/version-0.2"
FACTS: dict[str, Any] = json.loads((FILES / "facts.json").read_text("utf-8"))


@pytest.fixture(params=sorted(FACTS))
def storage(request: pytest.FixtureRequest, tmp_path: Path) -> Storage:
    """A data folder as version 0.2 left it."""
    with tarfile.open(FILES / f"{request.param}.tar.xz") as archive:
        archive.extractall(tmp_path, filter="data")
    return Storage(tmp_path / request.param)


def nodes_of(policy: Policy) -> list[dict[str, Any]]:
    """Describe each learned image: its bytes, its votes, and whether it is pinned."""
    return [
        {
            "image": hashlib.sha256(np.ascontiguousarray(node.image).tobytes()).hexdigest()[:16],
            "frames": int(node.frames),
            "votes": {move.value: count for move, count in image.votes.items()},
            "pinned": bool(image.is_pinned),
        }
        for node, image in zip(policy.learner.nodes(), images(policy), strict=True)
    ]


@pytest.mark.parametrize("has_models", [True, False])
def test_what_the_journal_holds_is_replayed_to_the_same_nodes(
    storage: Storage, has_models: bool
) -> None:
    facts = FACTS[storage.root.name]
    if has_models:
        assert ModelStore(storage).load(storage.root.name).summary.n_examples == facts["saved"]
    else:
        shutil.rmtree(storage.models)
    recovered = recover(storage.journal, ModelStore(storage))
    if recovered is None:  # the model's file has all of it
        assert has_models and facts["saved"] == facts["recovered"]
        model = ModelStore(storage).load(storage.root.name)
    else:
        assert recovered.replayed >= (0 if has_models else 7)
        model = recovered.model
    assert model.summary.n_examples == facts["recovered"]
    policy = model.to_policy()
    assert nodes_of(policy) == facts["nodes"]
    episode = open_episode(min(storage.folder("episodes").glob("*.mcap")))
    x = policy.extract(episode.frame(max(episode.frames)))
    for _ in range(6):
        policy.learn(x, Action.LEFT)
    policy.reset()
    assert policy.propose(1, x).action is Action.LEFT


def test_recordings_teach_the_same_nodes_again(storage: Storage) -> None:
    facts = FACTS[storage.root.name]["episodes"]
    store = EpisodeStore(storage)
    assert sorted(store.ids()) == sorted(facts)
    for episode_id, known in facts.items():
        summary, episode = store.summary(episode_id), open_episode(store.path(episode_id))
        assert (summary.frames, dict(summary.taught)) == (known["frames"], known["taught"])
        assert (summary.damage, episode.damage) == (known["damage"], known["damage"])
        before = episode.model_before()
        again = before.to_policy() if before else make_policy(storage.root.name)
        learn_again(again, [(episode, Notes())])
        assert nodes_of(again) == known["learned"]
        x = again.extract(episode.frame(list(episode.frames)[-1]))
        proposed = again.propose(1, x).probabilities
        shares = known["proposes"]  # rare labels weigh more today
        assert max(proposed, key=proposed.__getitem__) == max(shares, key=shares.__getitem__)
