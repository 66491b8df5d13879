"""A model survives conversion to bytes and back, and all other bytes are refused with a reason."""

from __future__ import annotations

import io
from collections import Counter
from copy import deepcopy
from functools import cache

import numpy as np
import pytest

from robot.errors import RecordingError
from robot.policy.policy import Policy
from robot.policy.registry import make_policy
from robot.store.models.model import Model, decode_model, decode_summary, encode_model, take_model
from robot.types import Action
from tests.kit.states import same_state
from tests.robot.bench_robot import BenchRobot


def taught_policy(learner: str, lessons: int = 40) -> Policy:
    policy, camera = make_policy(learner), BenchRobot().camera
    moves = policy.moves
    for scene in range(lessons):
        policy.learn(policy.extract(camera.show(scene)), moves[scene % len(moves)])
    return policy


@cache
def some_model(learner: str = "published-8") -> Model:
    taught = Counter({Action.FORWARD: 30, Action.LEFT: 10})
    return take_model(taught_policy(learner), taught, saved_at_s=1.5e9, place="the kitchen")


@pytest.mark.parametrize("learner", ["published-8", "default-8"])
def test_a_model_survives_a_round_trip_and_learns_on_the_same(learner):
    model = some_model(learner)
    data = encode_model(model)
    back = decode_model(data)
    assert back.summary == model.summary == decode_summary(data)
    assert same_state(back.state, model.state)
    policy, again, camera = taught_policy(learner), back.to_policy(), BenchRobot().camera
    for scene in range(100, 130):
        x = policy.extract(camera.show(scene))
        for each in (policy, again):
            each.learn(x, Action.LEFT)
    assert same_state(again.get_state(), policy.get_state())
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:  # the file opens in numpy
        assert b"kitchen" in arrays["meta"].tobytes()
        assert any(name.startswith("state.") for name in arrays.files)


def test_a_truncation_and_each_damaged_byte_are_noticed():
    data = encode_model(some_model())
    whole = decode_model(data)
    for length in (0, 1, 100, 5000):
        with pytest.raises(RecordingError):
            decode_model(data[:length])
    for offset in np.random.default_rng(1).integers(0, len(data), 200):
        damaged = bytearray(data)
        damaged[offset] ^= 0xFF
        try:
            model = decode_model(bytes(damaged))
        except RecordingError:
            continue
        assert same_state(model.state, whole.state), f"nobody noticed the change of byte {offset}"


@pytest.mark.parametrize(
    ("meta", "word"),
    [
        (np.array([print], dtype=object), "pickle"),
        (b"no json", "not a model"),
        (b"[]", "not a model"),
        (b'{"format": 99, "state": {"params": {}}}', "upgrade"),
        (b'{"format": 1, "state": {"params": {}}}', "damaged"),
    ],
)
def test_a_description_of_another_form_is_refused_and_pickles_are_never_opened(meta, word):
    file = io.BytesIO()
    np.savez(file, meta=np.frombuffer(meta, np.uint8) if isinstance(meta, bytes) else meta)
    with pytest.raises(RecordingError, match=word):
        decode_model(file.getvalue())


def test_a_model_of_an_unknown_learner_is_refused():
    model = deepcopy(some_model())
    object.__setattr__(model.summary, "learner", "multi-place-7")  # from version 0.2
    said = r"learner .multi-place-7. cannot be opened: unknown learner .multi-place-7.; choose "
    with pytest.raises(RecordingError, match=said):
        decode_model(encode_model(model)).to_policy()
