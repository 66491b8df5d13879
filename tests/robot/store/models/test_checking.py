"""Models from any source: a file that does not match its own description is refused unopened."""

from __future__ import annotations

import io
import itertools
import json
import tracemalloc
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from robot.errors import RecordingError
from robot.policy.registry import make_policy
from robot.store.folder import Storage
from robot.store.models.model import _checksum, decode_model, encode_model, take_model
from robot.store.models.store import ModelStore
from robot.store.models.trial import try_model
from robot.types import Action, Encoding
from tests.kit.frames import make_frame
from tests.learners import installed

LEARNERS = installed("default-4", "published-4", "whole-numbers-4", "integer-4", "knn-3")
Arrays = dict[str, NDArray[Any]]
FRAME = make_frame(bytes(2 * 160 * 120), Encoding.YUYV)


@lru_cache
def good(learner: str, lessons: int = 40) -> bytes:
    policy, rng = make_policy(learner), np.random.default_rng(1)
    dim, taught = policy.extract(FRAME).size, Counter[Action]()
    for i in range(lessons):
        label = policy.moves[i % 3]
        policy.learn(rng.integers(0, 256, dim).astype(np.uint8), label, i * 0.2)
        taught[label] += 1
        if i % 17 == 16:
            policy.reset()
    return encode_model(take_model(policy, taught, saved_at_s=1.7e9, place="hall"))


def parts(data: bytes) -> tuple[dict[str, Any], Arrays]:
    with np.load(io.BytesIO(data)) as file:
        arrays = {name: file[name] for name in file.files}
    return json.loads(arrays.pop("meta").tobytes()), arrays


def packed(meta: dict[str, Any], arrays: Arrays, *, is_signed: bool = True) -> bytes:
    """Return the file of these values, with a valid checksum, so that only the values are wrong."""
    if is_signed:
        meta = {**meta, "sha256": _checksum(meta, arrays)}
    file = io.BytesIO()
    text = json.dumps(meta).encode()
    np.savez(file, meta=np.frombuffer(text, np.uint8), **arrays)
    return file.getvalue()


LATER = ("touched", "novelty", "contradicted", "contradicted_since", "taken_up", "repeats")
LATER += ("repeats_labels",)
"""Arrays that a model of 0.1 or 0.2 lacks."""


def of_array(name: str, array: NDArray[Any]) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield the possible faults of an array, each with the wrong array."""
    yield "text", np.array(["x"])
    yield "complex", array.astype(np.complex128)
    yield "of no dimension", np.zeros((), array.dtype)
    yield "another dtype", np.zeros(array.shape, np.float16)
    yield "big-endian", np.zeros(array.shape, ">i8")
    yield "one more dimension", array[None]
    for axis, side in enumerate(array.shape):
        for step in (-1, 1) if side else (1,):
            sides = (*array.shape[:axis], side + step, *array.shape[axis + 1 :])
            yield f"{step:+} in {axis}", np.ones(sides, array.dtype)

    def with_first(value: float) -> NDArray[Any]:
        wrong = array.copy()
        wrong.reshape(-1)[:1] = value
        return wrong

    if array.size and array.dtype.kind == "f":
        for value in (np.nan, -np.inf, 1e30, *(() if name.endswith("weights") else (np.inf,))):
            yield f"begins with {value}", with_first(value)
    if array.size and array.dtype.kind == "i":
        if not name.endswith(("linear", "residual")):
            yield "negative", with_first(-1)
        yield "huge", np.full(array.shape, 2**60)
    if array.size and array.dtype in (np.int32, np.uint16):
        for value in (-1, int(np.iinfo(array.dtype).max) + 1):
            yield f"of {value} only", np.full(array.shape, value, np.int64)


def of_params(value: Any, path: tuple[Any, ...]) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """Yield places in a description, each with a wrong value."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from of_params(inner, (*path, key))
        wrong: tuple[Any, ...] = (None, [], "x", 7) if value else (None, "x", 7)
    elif isinstance(value, list):
        for i, inner in enumerate(value[:3]):
            yield from of_params(inner, (*path, i))
        wrong = (None, "x", 7, {}, [*value, "fly"], [[]]) if path[-1] != "pending" else (None, 7)
    elif isinstance(value, bool) or value is None:
        wrong = ()
    elif isinstance(value, int):
        wrong = (-1, 10**40, float("nan"), float("inf"), "x", [], {}, None, True)
    elif isinstance(value, float):
        wrong = (float("nan"), float("inf"), -1e300, "x", [], {}, None)
    else:
        wrong = (None, 7, [], {}, "no such thing", "x" * 10_000, "\ud83d")
    for bad in wrong:
        yield path, bad


def put_at(plain: Any, path: tuple[Any, ...], value: Any) -> Any:
    if not path:
        return value
    copy = dict(plain) if isinstance(plain, dict) else list(plain)
    copy[path[0]] = put_at(plain[path[0]], path[1:], value)
    return copy


FREE = ("place", "sha256")
MAY_BE_ANY = {
    ("place",),
    ("saved_at_s",),
    ("format",),
    ("n_nodes",),
    ("journal",),
    ("state", "params", "last_learned"),
    ("state", "params", "context", "move"),
    ("state", "params", "context", "before"),
    ("state", "params", "learner", "place"),
    ("state", "params", "learner", "size"),
}


def malformed(learner: str, every: int = 1) -> Iterator[tuple[str, bytes]]:
    """Yield faults with their files; only a sample, because packing a large model takes long."""
    for what, meta, arrays in itertools.islice(_wrong(learner), 0, None, every):
        yield what, packed(meta, arrays)
    meta, arrays = parts(good(learner))
    yield "a wrong checksum", packed(put_at(meta, ("sha256",), "0" * 64), arrays, is_signed=False)


def _wrong(learner: str) -> Iterator[tuple[str, dict[str, Any], Arrays]]:
    meta, arrays = parts(good(learner))
    for name, array in arrays.items():
        if name == "state.pace_picture" or name.endswith("novelty"):
            continue
        if not name.endswith(LATER):
            yield f"no {name}", meta, {n: each for n, each in arrays.items() if n != name}
        for what, wrong in of_array(name, array):
            yield f"{name} {what}", meta, {**arrays, name: wrong}
    for path, bad in of_params(meta, ()):
        if not path or path[0] in FREE or path[:3] == ("state", "params", "pace"):
            continue
        if path == ("moves",) and isinstance(bad, list) and len(bad) > 1:
            continue  # a driver may have declared it
        if (bad is None or isinstance(bad, bool)) and path in MAY_BE_ANY:
            continue
        if path[:1] == ("saved_at_s",) and isinstance(bad, float) and bad == -1e300:
            continue
        yield f"{'.'.join(map(str, path))} = {str(bad)[:30]}", put_at(meta, path, bad), arrays
    for key in ("learner", "moves", "taught", "n_nodes", "saved_at_s", "place", "state"):
        yield f"no {key}", {k: v for k, v in meta.items() if k != key}, arrays
    for what, name in (("larger", "9"), ("huge", "999999"), ("none", "0"), ("unknown", "")):
        kind = learner.rsplit("-", 1)[0]
        named = f"{kind}-{name}" if name else "oracle-4"
        yield f"learner {what}", put_at(meta, ("learner",), named), arrays
    yield "a strange array", meta, {**arrays, "state.strange": np.zeros(3)}


@pytest.mark.parametrize("learner", [*LEARNERS, "default-32", *installed("without-linear-4")])
def test_every_model_of_ours_is_accepted_drives_and_learns(tmp_path: Path, learner: str) -> None:
    store = ModelStore(Storage(tmp_path))
    for lessons in (0, 1, 3, 40):
        data = good(learner, lessons)
        name = store.add_file("x", data)
        assert store.read_file(name) == data
        policy = store.load(name).to_policy()
        assert policy.n_seen == lessons
    x = policy.extract(FRAME)
    assert policy.propose(1, x).action in policy.moves
    policy.learn(x, Action.LEFT, 99.0)


def test_models_are_refused_before_they_are_unpacked(tmp_path: Path) -> None:
    """A packed file of zeros, and a header that claims more data than there is."""
    store = ModelStore(Storage(tmp_path))
    bomb, claim = io.BytesIO(), io.BytesIO()
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("meta.npy", bytes(300 * 2**20))
    with zipfile.ZipFile(claim, "w") as archive, archive.open("meta.npy", "w") as member:
        header = {"descr": "|u1", "fortran_order": False, "shape": (2**45,)}
        np.lib.format.write_array_header_1_0(member, header)

    def refuse() -> None:
        for data in (bomb.getvalue(), claim.getvalue()):
            with pytest.raises(RecordingError):
                store.add_file("x", data)
        with pytest.raises(RecordingError, match="256 MB"):
            decode_model(bomb.getvalue())

    assert peak_of(refuse) < 4 * 2**20


def peak_of(task: Callable[[], object]) -> int:
    """Return the most memory that a task takes, in bytes."""
    tracemalloc.start()
    task()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


@pytest.mark.parametrize("learner", ["default-300", "published-200"])
def test_an_upload_takes_no_more_than_its_trial_needs(tmp_path: Path, learner: str) -> None:
    store = ModelStore(Storage(tmp_path))
    data = good(learner, 50)
    try_model(decode_model(data))  # imports and caches of this kind of model
    # The trial itself is the baseline: NumPy 2.5 needs one more matrix to check a factorisation.
    trial = peak_of(lambda: try_model(decode_model(data)))
    assert peak_of(lambda: store.add_file("x", data)) <= 1.1 * trial
