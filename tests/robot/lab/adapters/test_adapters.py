"""The adapters pass all checks of their libraries, and learn from the libraries' streams."""

from concurrent.futures import ThreadPoolExecutor
from importlib.util import find_spec
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


# Only the worker that runs these tests loads scikit-learn, because that takes a second.
def for_sklearn(**options: Any) -> Any:
    from robot.lab.adapters.for_sklearn import BSOCEstimator

    return BSOCEstimator(**options)


def for_river(**options: Any) -> Any:
    from robot.lab.adapters.for_river import RiverBSOC

    return RiverBSOC(**options)


@pytest.mark.parametrize("options", [{}, {"max_nodes": 8, "penalty": 1.0}])
def test_the_adapter_passes_each_check_of_scikit_learn(options):
    from sklearn.utils.estimator_checks import check_estimator

    ran = check_estimator(for_sklearn(**options), on_skip=None)
    assert sum(check["status"] == "passed" for check in ran) > 50


def test_the_adapter_passes_each_check_of_river():
    from river import checks

    model = for_river(max_nodes=8)
    for check in checks.yield_checks(model):
        check(model.clone())


def blobs(n: int = 300) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    ys = rng.integers(0, 3, n)
    return rng.normal(size=(n, 5)) + 3.0 * np.eye(5)[ys], ys


def test_partial_fit_equals_fit_and_a_class_may_come_late():
    xs, ys = blobs()
    words = np.array(["stop", "left", "go"])[ys]
    late = np.argsort(words == "go", kind="stable")
    xs, words = xs[late], words[late]
    at_once, in_parts = for_sklearn().fit(xs, words), for_sklearn()
    for i in range(0, len(xs), 37):
        in_parts.partial_fit(xs[i : i + 37], words[i : i + 37])
    assert in_parts.classes_.tolist() == ["go", "left", "stop"]
    np.testing.assert_array_equal(at_once.predict_proba(xs), in_parts.predict_proba(xs))
    assert at_once.score(xs, words) > 0.9


def test_river_takes_any_label_and_features_that_come_late():
    model = for_river()
    labels = [None, 3, ("a", 1), 2.5]
    for i in range(120):
        kind = i % 4
        names = {f"{kind}-{j}": 1.0 + 0.01 * i for j in range(12)}  # 48 names in the end
        model.learn_one(names, labels[kind])
    for kind, label in enumerate(labels):
        assert model.predict_one({f"{kind}-{j}": 1.5 for j in range(12)}) == label
    assert model.predict_proba_one({"never seen": 1.0}).keys() == set(labels)


@pytest.mark.parametrize("bad", [float("nan"), 1e39, "text"])
def test_after_a_refused_example_river_is_answered_as_before(bad):
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


def test_after_a_refused_example_scikit_learn_is_answered_as_before():
    days = for_sklearn().partial_fit([[0.9]], ["day"], classes=["night", "dusk", "day"])
    before = days.predict_proba([[0.9]])
    with pytest.raises(ValueError, match="large"):
        days.partial_fit([[1e30]], ["dusk"])
    with pytest.raises(ValueError, match=r"'dawn'.*first call"):
        days.partial_fit([[0.5], [0.1]], ["night", "dawn"])
    with pytest.raises(ValueError, match="differ from the first call's"):
        days.partial_fit([[0.5]], ["dawn"], classes=["dawn", "day", "dusk", "night"])
    with pytest.raises(ValueError, match="'dawn'"):
        for_sklearn().partial_fit([[0.5]], ["dawn"], classes=["day"])
    assert days.classes_.tolist() == ["day", "dusk", "night"]
    np.testing.assert_array_equal(days.predict_proba([[0.9]]), before)
    assert days.partial_fit([[0.1]], ["night"]).predict([[0.1], [0.9]]).tolist() == ["night", "day"]


@pytest.mark.parametrize("penalty", [None, 1.0])
def test_a_model_that_is_mapped_into_memory_learns_on_and_is_asked_on_many_threads(
    tmp_path, penalty
):
    joblib = pytest.importorskip("joblib")
    xs, ys = blobs()
    whole = for_sklearn(max_nodes=16, penalty=penalty).fit(xs, ys)
    joblib.dump(whole, tmp_path / "model")
    mapped = joblib.load(tmp_path / "model", mmap_mode="r")
    file = (tmp_path / "model").read_bytes()
    for estimator in (whole, mapped):
        estimator.partial_fit(xs[::-1], ys[::-1])
    alone = whole.predict_proba(xs)
    with ThreadPoolExecutor(8) as pool:
        together = list(pool.map(lambda row: mapped.predict_proba(row[None])[0], xs))
    np.testing.assert_array_equal(alone, together)
    assert (tmp_path / "model").read_bytes() == file


@pytest.mark.parametrize(
    ("stream", "classes"), [("digits", 10), ("image segments", 7), ("text", 3)]
)
def test_a_stream_beyond_driving_is_whole_and_the_same_each_time(stream, classes):
    from robot.lab.streams import read_stream, run_stream

    examples = read_stream(stream)
    assert len(examples) > 1000
    assert len({label for _, label in examples}) == classes
    assert len({x.shape for x, _ in examples}) == 1
    again = read_stream(stream)
    assert all((x == y).all() for (x, _), (y, _) in zip(examples, again, strict=True))
    if stream == "digits":
        first, second = (
            run_stream({"stream": stream, "learner": "BSOC-128", "seed": 1}) for _ in range(2)
        )
        assert first == second and first["right"] > 0.88 * first["examples"]
