"""The adapters pass all checks of their libraries, and predict on several threads."""

from __future__ import annotations

import pickle
from concurrent.futures import ThreadPoolExecutor
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytestmark = [
    pytest.mark.filterwarnings("ignore"),
    pytest.mark.skipif(
        not (find_spec("sklearn") and find_spec("river")),
        reason="NOT TESTED: the extra learners is not installed",
    ),
]


# Loaded only by the worker that runs these tests: scikit-learn takes a second.
def for_sklearn(**options: Any) -> Any:
    from robot.lab.adapters.for_sklearn import BSOCEstimator

    return BSOCEstimator(**options)


def for_river(**options: Any) -> Any:
    from robot.lab.adapters.for_river import RiverBSOC

    return RiverBSOC(**options)


@pytest.mark.parametrize("options", [{}, {"max_nodes": 8, "penalty": 1.0}])
def test_it_passes_each_check_of_scikit_learn(options: dict[str, Any]) -> None:
    from sklearn.utils.estimator_checks import check_estimator

    ran = check_estimator(for_sklearn(**options), on_skip=None)
    assert sum(check["status"] == "passed" for check in ran) > 50


def test_it_passes_each_check_of_river() -> None:
    from river import checks

    model = for_river(max_nodes=8)
    for check in checks.yield_checks(model):
        check(model.clone())


def blobs(n: int = 300) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    ys = rng.integers(0, 3, n)
    return rng.normal(size=(n, 5)) + 3.0 * np.eye(5)[ys], ys


def test_predictions_are_the_same_on_many_threads_and_in_read_only_memory() -> None:
    xs, ys = blobs()
    estimator = for_sklearn(max_nodes=16, penalty=1.0).fit(xs, ys)
    kept: list[Any] = []
    text = pickle.dumps(estimator, protocol=5, buffer_callback=kept.append)
    frozen = pickle.loads(text, buffers=[bytes(buffer.raw()) for buffer in kept])
    assert not frozen.learner_.cluster._images._rows.flags.writeable
    alone = [estimator.predict_proba(row[None]) for row in xs]
    with ThreadPoolExecutor(8) as pool:
        together = list(pool.map(lambda row: frozen.predict_proba(row[None]), xs))
    np.testing.assert_array_equal(alone, together)


def test_partial_fit_equals_fit_and_a_class_may_come_late() -> None:
    from sklearn.base import clone

    xs, ys = blobs()
    words = np.array(["stop", "left", "go"])[ys]
    at_once = for_sklearn().fit(xs, words)
    in_parts = clone(at_once)
    late = np.argsort(words == "go", kind="stable")
    xs, words = xs[late], words[late]
    at_once.fit(xs, words)
    for i in range(0, len(xs), 37):
        in_parts.partial_fit(xs[i : i + 37], words[i : i + 37])
    assert in_parts.classes_.tolist() == ["go", "left", "stop"]
    np.testing.assert_array_equal(at_once.predict_proba(xs), in_parts.predict_proba(xs))
    assert at_once.score(xs, words) > 0.9


def test_river_takes_any_label_and_features_that_come_late() -> None:
    model = for_river()
    labels = [None, 3, ("a", 1), 2.5]
    for i in range(120):
        kind = i % 4
        names = {f"{kind}-{j}": 1.0 + 0.01 * i for j in range(12)}  # 48 names in all
        model.learn_one(names, labels[kind])
    for kind, label in enumerate(labels):
        assert model.predict_one({f"{kind}-{j}": 1.5 for j in range(12)}) == label
    assert model.predict_proba_one({"never seen": 1.0}).keys() == set(labels)


@pytest.mark.parametrize("bad", [float("nan"), 1e39, "text"])
def test_after_a_refused_example_river_is_answered_as_before(bad: Any) -> None:
    model = for_river()
    with pytest.raises(ValueError):
        model.learn_one({"light": bad}, "dusk")
    assert model.predict_proba_one({"light": 1.0}) == {}
    model.learn_one({"light": 0.9}, "day")
    with pytest.raises(ValueError):
        model.learn_one({"light": bad, "wind": 1.0}, "dusk")
    model.learn_one({"light": 0.1}, "night")
    known = model.predict_proba_one({"light": 1.0})
    assert known.keys() == {"day", "night"}
    assert model.predict_proba_one({"light": 1.0, "wind": 9.0}) == known


def test_after_a_refused_example_scikit_learn_is_answered_as_before() -> None:
    estimator = for_sklearn().partial_fit([[0.9]], ["day"], classes=["day", "dusk", "night"])
    with pytest.raises(ValueError, match="large"):
        estimator.partial_fit([[1e30]], ["dusk"])
    assert estimator.partial_fit([[0.1]], ["night"]).predict_proba([[0.1]]).shape == (1, 3)
    assert estimator.predict([[0.1], [0.9]]).tolist() == ["night", "day"]


def test_a_label_outside_of_classes_is_refused_and_the_columns_stay() -> None:
    named = for_sklearn().partial_fit([[0.9]], ["day"], classes=["night", "dusk", "day"])
    before = named.predict_proba([[0.9]])
    for classes in (None, ["day", "dusk", "night"]):
        with pytest.raises(ValueError, match=r"'dawn'.*first call"):
            named.partial_fit([[0.5], [0.1]], ["night", "dawn"], classes=classes)
    with pytest.raises(ValueError, match="differ from the first call's"):
        named.partial_fit([[0.5]], ["dawn"], classes=["dawn", "day", "dusk", "night"])
    assert named.classes_.tolist() == ["day", "dusk", "night"]
    np.testing.assert_array_equal(named.predict_proba([[0.9]]), before)
    with pytest.raises(ValueError, match="'dawn'"):
        for_sklearn().partial_fit([[0.5]], ["dawn"], classes=["day"])


@pytest.mark.parametrize("penalty", [None, 1.0])
def test_it_learns_on_from_a_file_that_is_mapped_into_memory(
    tmp_path: Path, penalty: float | None
) -> None:
    joblib = pytest.importorskip("joblib")
    xs, ys = blobs()
    whole = for_sklearn(max_nodes=16, penalty=penalty).fit(xs, ys)
    joblib.dump(whole, tmp_path / "model")
    mapped = joblib.load(tmp_path / "model", mmap_mode="r")
    file = (tmp_path / "model").read_bytes()
    for estimator in (whole, mapped):
        estimator.partial_fit(xs[::-1], ys[::-1])
    np.testing.assert_array_equal(whole.predict_proba(xs), mapped.predict_proba(xs))
    assert (tmp_path / "model").read_bytes() == file
