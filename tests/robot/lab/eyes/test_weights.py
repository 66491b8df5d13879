from __future__ import annotations

import os
import pickle
from pathlib import Path

import numpy as np
import pytest

from robot.errors import ConfigurationError, MissingExtraError
from robot.lab.eyes import weights
from robot.policy.registry import make_policy


def package(folder: Path, data: bytes | None) -> None:
    """Make a package of weights."""
    file = folder / weights.PACKAGE / weights.FILE
    file.parent.mkdir(parents=True)
    (folder / weights.PACKAGE / "__init__.py").touch()
    if data is not None:
        file.write_bytes(data)


def test_without_the_extra_it_says_what_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(weights, "PACKAGE", "a_package_that_is_not_there")
    with pytest.raises(MissingExtraError, match=r"kind eyes needs drivelesson\[eyes\].*install"):
        weights.load_weights()


@pytest.mark.parametrize(("data", "words"), [(None, "cannot read"), (b"else", "damaged")])
def test_a_broken_installation_is_a_sentence(
    data: bytes | None, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(weights, "PACKAGE", "weights_that_are_broken")
    package(tmp_path, data)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ConfigurationError, match=words):
        weights.load_weights()


@pytest.mark.parametrize("thing", [os.system, eval, np.load, pickle.loads])
def test_a_file_can_run_no_code(thing: object) -> None:
    table = pickle.dumps(thing)
    with pytest.raises(pickle.UnpicklingError, match="may not name"):
        weights.read_tensors(table * 5)


def test_tensors_come_with_their_shapes_and_places() -> None:
    """A file by hand: two tensors in one storage, one of them transposed."""
    stored = np.arange(10, dtype="<f4")
    tensor = b"ctorch._utils\n_rebuild_tensor_v2\n"
    storage = b"(Vstorage\nctorch\nFloatStorage\nVkey\nVcpu\nI10\nNtQ"

    def entry(name: bytes, offset: bytes, shape: bytes, strides: bytes) -> bytes:
        where = b"I" + offset + b"\n(" + shape + b"t(" + strides + b"t"
        return b"V" + name + b"\n" + tensor + b"(" + storage + where + b"I00\n}tR"

    table = (
        b"("
        + entry(b"one", b"0", b"I4\n", b"I1\n")
        + entry(b"two", b"4", b"I2\nI3\n", b"I1\nI2\n")
        + b"d."
    )
    data = pickle.dumps(1) * 3 + table + pickle.dumps(["key"])
    data += (10).to_bytes(8, "little") + stored.tobytes()
    read = weights.read_tensors(data)
    assert list(read) == ["one", "two"]
    assert np.array_equal(read["one"], [0, 1, 2, 3])
    assert np.array_equal(read["two"], [[4, 6, 8], [5, 7, 9]])


def test_the_learner_says_so_too(monkeypatch: pytest.MonkeyPatch) -> None:
    from robot.lab.eyes import network

    network._compiled.cache_clear()
    monkeypatch.setattr(weights, "PACKAGE", "a_package_that_is_not_there")
    with pytest.raises(MissingExtraError, match=r"drivelesson\[eyes\]"):
        make_policy("eyes-32")
