"""What version 0.1 wrote still opens, says the same, and can be taught further."""

from __future__ import annotations

import json
import lzma
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robot.coaching.gallery import images
from robot.policy.registry import Design, make_policy, split_name
from robot.recordings.edits import Notes
from robot.recordings.episode import open_episode
from robot.recordings.store import EpisodeStore
from robot.recordings.teaching import learn_again
from robot.store.folder import Storage
from robot.store.models.model import decode_model, encode_model, take_model
from robot.store.models.store import ModelStore
from robot.store.models.trial import try_model
from robot.types import Action

FILES = Path(__file__).parents[1] / "vectors/version-0.1"
FACTS: dict[str, Any] = json.loads((FILES / "facts.json").read_text("utf-8"))
MODELS = sorted(FACTS)
EPISODES = {
    "published-4": "published-4",
    "default-6": "default-6",
    "without-linear-4": "published-4",
}
"""Model to the recording of the same pictures."""


@pytest.fixture
def storage(tmp_path: Path) -> Storage:
    """A data folder as version 0.1 left it."""
    for name in MODELS:
        (tmp_path / "models" / name).mkdir(parents=True)
        data = lzma.decompress((FILES / f"{name}.npz.xz").read_bytes())
        (tmp_path / "models" / name / "00001.npz").write_bytes(data)
    (tmp_path / "models/current.txt").write_text("default-6\n")
    (tmp_path / "episodes").mkdir()
    for name in set(EPISODES.values()):
        data = lzma.decompress((FILES / f"{name}.mcap.xz").read_bytes())
        (tmp_path / "episodes" / f"{name}.mcap").write_bytes(data)
    return Storage(tmp_path)


@pytest.mark.parametrize("name", MODELS)
def test_a_model_opens_with_all_that_it_knew(storage: Storage, name: str) -> None:
    store, facts = ModelStore(storage), FACTS[name]
    assert store.current == "default-6" and sorted(store.names()) == MODELS
    model = store.load(name)
    policy = model.to_policy()
    assert {move.value: n for move, n in model.summary.taught.items()} == facts["taught"]
    shown = [{m.value: n for m, n in image.votes.items()} for image in images(policy)]
    assert shown == facts["images"] and len(shown) == facts["nodes"]


@pytest.mark.parametrize("name", MODELS)
def test_a_model_proposes_the_same_and_learns_on(storage: Storage, name: str) -> None:
    episode = open_episode(storage.folder("episodes") / f"{EPISODES[name]}.mcap")
    policy = ModelStore(storage).load(name).to_policy()
    x = policy.extract(episode.frame(list(episode.frames)[-1]))
    proposed = policy.propose(1, x).probabilities
    shares = FACTS[name]["proposes"]  # rare labels weigh more today
    assert max(proposed, key=proposed.__getitem__) == max(shares, key=shares.__getitem__)
    for _ in range(6):
        policy.learn(x, Action.LEFT)
    policy.reset()
    assert policy.propose(2, x).action is Action.LEFT


@pytest.mark.parametrize("name", sorted(set(EPISODES.values())))
def test_a_recording_opens_whole_and_teaches_the_same_again(storage: Storage, name: str) -> None:
    [summary] = [summary for summary in EpisodeStore(storage).summaries() if summary.id == name]
    assert summary.is_readable and summary.damage is None and summary.learner == name
    assert (summary.frames, dict(summary.taught)) == (10, FACTS[name]["recorded"])

    episode = open_episode(storage.folder("episodes") / f"{name}.mcap")
    before, after = episode.model_before(), episode.model_after()
    assert before is not None and before.summary.taught == {} and after is not None
    kind, number = split_name(name)
    again = make_policy(name)
    if kind == "default":  # what came later would learn otherwise
        older = Design(knows_repeats=False, is_smooth=False)
        again = older.make(number, name, again.moves, False)
    report = learn_again(again, [(episode, Notes())])
    assert {move.value: n for move, n in report.taught.items()} == FACTS[name]["taught"]
    learned = again.get_state().arrays
    kept = {name: a for name, a in after.state.arrays.items() if name != "cluster_weights"}
    assert kept.keys() - {"inverse"} <= learned.keys()  # weights follow from the distances
    for array, values in kept.items():
        if array == "inverse":  # half of it is kept, less what waits
            size, waiting = len(values), learned["waiting"]
            half = np.zeros((size, size))
            half[np.triu_indices(size)] = learned["triangle"]
            np.testing.assert_allclose(half, np.triu(values + waiting.T @ waiting), atol=1e-5)
        elif array == "linear":
            np.testing.assert_allclose(learned[array], values, atol=1e-5)
        else:
            assert np.array_equal(learned[array], values), array


def test_a_model_in_whole_numbers_of_64_bits_opens() -> None:
    """Version 0.1 kept sums and images in int64, the images in steps of 1/256."""
    policy = make_policy("whole-numbers-4")
    views = np.random.default_rng(5).integers(0, 256, (40, 1584)).astype(np.uint8)
    for i, x in enumerate(views):
        policy.learn(x, policy.moves[i % 3], 0.2 * i)
    today = take_model(policy, Counter({Action.LEFT: 40}), saved_at_s=0.0)
    arrays = dict(today.state.arrays)
    arrays["cluster_sums"] = arrays["cluster_sums"].astype(np.int64)
    sums = arrays["cluster_sums"]
    arrays["cluster_images"] = sums[:, :1]  # whatever it is: the images follow from the sums
    was = decode_model(encode_model(replace(today, state=replace(today.state, arrays=arrays))))
    try_model(was)
    opened = was.to_policy()
    for array, values in today.state.arrays.items():
        assert np.array_equal(opened.get_state().arrays[array], values), array
    for x in views:
        assert opened.propose(1, x).probabilities == policy.propose(1, x).probabilities
