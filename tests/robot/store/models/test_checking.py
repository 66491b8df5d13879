"""Models from any source: a file that does not match its own description is refused unopened."""

from __future__ import annotations

import io
import itertools
import json
import tracemalloc
import zipfile
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
from tests.kit.sizes import crossed
from tests.learners import installed

LEARNERS = installed("default-4", "published-4", "whole-numbers-4", "integer-4", "knn-3")
Arrays = dict[str, NDArray[Any]]
FRAME = make_frame(bytes(2 * 160 * 120), Encoding.YUYV)


@lru_cache
def good(learner: str, lessons: int = 40) -> bytes:
    policy = make_policy(learner)
    rng = np.random.default_rng(1)
    dim = policy.extract(FRAME).size
    taught = {}
    for i in range(lessons):
        label = policy.moves[i % 3]
        policy.learn(rng.integers(0, 256, dim).astype(np.uint8), label, i * 0.2)
        taught[label] = taught.get(label, 0) + 1
        if i % 17 == 16:
            policy.reset()
    from collections import Counter

    return encode_model(take_model(policy, Counter(taught), saved_at_s=1.7e9, place="hall"))


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


Change = Callable[[dict[str, Any], Arrays], None]


def of_arrays(arrays: Arrays) -> Iterator[tuple[str, Change]]:
    """Yield the possible faults of each array."""
    for name, array in arrays.items():
        if name == "state.pace_picture" or name.endswith("novelty"):
            continue

        def put(make: Callable[[NDArray[Any]], NDArray[Any]], name: str = name) -> Change:
            return lambda meta, arrays: arrays.update({name: make(arrays[name].copy())})

        def fill(value: Any, name: str = name) -> Change:
            def change(meta: dict[str, Any], arrays: Arrays) -> None:
                array = arrays[name].copy()
                array.reshape(-1)[:1] = value
                arrays[name] = array

            return change

        def drop(meta: dict[str, Any], arrays: Arrays, name: str = name) -> None:
            del arrays[name]

        later = ("touched", "novelty", "contradicted", "contradicted_since", "taken_up")
        later += ("repeats", "repeats_labels")
        if not name.endswith(later):  # than 0.1, or than 0.2
            yield f"{name} missing", drop
        yield f"{name} text", put(lambda a: np.array(["x"]))
        yield f"{name} complex", put(lambda a: a.astype(np.complex128))
        yield f"{name} of no dimension", put(lambda a: np.zeros((), a.dtype))
        yield f"{name} another dtype", put(lambda a: np.zeros(a.shape, np.float16))
        yield f"{name} big-endian", put(lambda a: np.zeros(a.shape, ">i8"))
        yield f"{name} one more dimension", put(lambda a: a[None])
        for axis in range(array.ndim):
            sides = array.shape
            for what, step in (("short", -1), ("long", 1)):
                if sides[axis] + step >= 0:
                    other = (*sides[:axis], sides[axis] + step, *sides[axis + 1 :])
                    yield f"{name} {what} in {axis}", put(lambda a, o=other: np.ones(o, a.dtype))
        if array.size and array.dtype.kind == "f":
            yield f"{name} NaN", fill(np.nan)
            yield f"{name} minus infinite", fill(-np.inf)
            if not name.endswith("weights"):
                yield f"{name} infinite", fill(np.inf)
            yield f"{name} huge", fill(1e30)
        if array.size and array.dtype.kind == "i":
            if not name.endswith(("linear", "residual")):
                yield f"{name} negative", fill(-1)
            yield f"{name} huge", put(lambda a: np.full(a.shape, 2**60))
        if array.size and array.dtype in (np.int32, np.uint16):
            beyond = int(np.iinfo(array.dtype).max) + 1
            yield f"{name} too large", put(lambda a, b=beyond: np.full(a.shape, b, np.int64))
            yield f"{name} too small", put(lambda a: np.full(a.shape, -1, np.int64))


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
    for what, change in of_arrays(arrays):
        wrong_meta, wrong = dict(meta), dict(arrays)
        change(wrong_meta, wrong)
        yield what, wrong_meta, wrong
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


@crossed(learner=[*LEARNERS, "default-32", *installed("without-linear-4")], lessons=[0, 1, 3, 40])
def test_every_model_of_ours_is_let_in(tmp_path: Path, learner: str, lessons: int) -> None:
    store = ModelStore(Storage(tmp_path))
    data = good(learner, lessons)
    assert store.read_file(store.add_file("x", data)) == data
    assert store.load("x").to_policy().n_seen == lessons


def test_what_is_refused_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    """A packed file of zeros, and a header that claims more data than there is."""
    store = ModelStore(Storage(tmp_path))
    bomb = io.BytesIO()
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("meta.npy", bytes(200 * 2**20))
    claim = io.BytesIO()
    with zipfile.ZipFile(claim, "w") as archive, archive.open("meta.npy", "w") as member:
        header = {"descr": "|u1", "fortran_order": False, "shape": (2**45,)}
        np.lib.format.write_array_header_1_0(member, header)
    tracemalloc.start()
    for data in (bomb.getvalue(), claim.getvalue()):
        with pytest.raises(RecordingError):
            store.add_file("x", data)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 4 * 2**20


@pytest.mark.parametrize("learner", ["default-300", "published-200"])
def test_an_upload_takes_no_more_than_its_trial_needs(tmp_path: Path, learner: str) -> None:
    store = ModelStore(Storage(tmp_path))
    data = good(learner, 50)
    try_model(decode_model(data))  # imports and caches of this kind of model

    def peak_of(task: Callable[[], object]) -> int:
        tracemalloc.start()
        task()
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak

    # The trial itself is the baseline: NumPy 2.5 needs one more matrix to check a factorisation.
    trial = peak_of(lambda: try_model(decode_model(data)))
    assert peak_of(lambda: store.add_file("x", data)) <= 1.1 * trial


def test_a_model_that_is_let_in_drives_and_learns(tmp_path: Path) -> None:
    store = ModelStore(Storage(tmp_path))
    for learner in LEARNERS:
        policy = store.load(store.add_file("x", good(learner))).to_policy()
        x = policy.extract(FRAME)
        assert policy.propose(1, x).action in policy.moves
        policy.learn(x, Action.LEFT, 99.0)
