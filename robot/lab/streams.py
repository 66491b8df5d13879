"""Experiment on streams of examples that are not about driving: digits, parts of images, text.

Each example is predicted, then learned.
"""

from __future__ import annotations

import inspect
import pkgutil
import re
from collections.abc import Callable, Iterator
from functools import partial
from importlib import import_module
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.errors import MissingExtraError
from robot.lab.adapters.for_river import RiverBSOC
from robot.lab.adapters.for_sklearn import BSOCEstimator
from robot.lab.chance import mean_in_interval
from robot.lab.experiment import Experiment, ExperimentSettings, Runs, group, seeded
from robot.lab.task import Params, Result, Task
from robot.study.table import Table

try:
    from river import datasets, linear_model, naive_bayes, neighbors, preprocessing, tree
    from river.compat import convert_sklearn_to_river
    from sklearn.datasets import load_digits
    from sklearn.feature_extraction.text import HashingVectorizer
    from sklearn.linear_model import Perceptron, SGDClassifier
except ImportError as error:
    raise MissingExtraError("the experiment streams", "learners") from error

STREAMS = ("digits", "image segments", "text")
_N_HASHES = 512
_SENTENCES = 500
Example = tuple[NDArray[np.float64], str]


def _plan(settings: ExperimentSettings) -> Iterator[Task]:
    learners = tuple(LEARNERS)[:3] if settings.quick else LEARNERS
    cases = (
        {"stream": stream, "learner": learner} for stream, learner in product(STREAMS, learners)
    )
    return seeded(run_stream, cases, settings)


def _tables(runs: Runs) -> list[Table]:
    """Return one table with a row for each learner and a column for each stream."""
    rows: dict[str, list[str]] = {}
    for (learner, _), results in group(runs, "learner", "stream").items():
        rights = [result["right"] / result["examples"] for result in results]
        rows.setdefault(learner, []).append(mean_in_interval(rights, 3))
    lines = tuple((learner, *cells) for learner, cells in rows.items())
    return [Table(title="Predicted right", columns=("", *STREAMS), rows=lines)]


def run_stream(params: Params) -> Result:
    """Predict each example of a stream, then learn it. Parameters: `stream`, `learner`, `seed`."""
    examples = read_stream(params["stream"])
    order = np.random.default_rng(params["seed"]).permutation(len(examples))
    scaler, learner = preprocessing.StandardScaler(), LEARNERS[params["learner"]]()
    right = 0
    for i in order:
        x = dict(enumerate(examples[i][0].tolist()))
        scaler.learn_one(x)
        scaled = scaler.transform_one(x)
        right += learner.predict_one(scaled) == examples[i][1]
        learner.learn_one(scaled, examples[i][1])
    return {"right": int(right), "examples": len(examples)}


_LIBRARIES = ("numpy", "sklearn", "river")
_CLASSES = [
    *map(str, range(10)),
    *("brickface", "cement", "foliage", "grass", "path", "sky", "window"),
    *_LIBRARIES,
]
_one_by_one = partial(convert_sklearn_to_river, classes=_CLASSES)
LEARNERS: dict[str, Callable[[], Any]] = {
    "BSOC-32": lambda: RiverBSOC(32),
    "BSOC-128": lambda: RiverBSOC(128),
    "BSOC-128 with its ridge": lambda: _one_by_one(BSOCEstimator(128, penalty=10.0)),
    "river, 5-nn of the last 1000": neighbors.KNNClassifier,
    "river, softmax regression": linear_model.SoftmaxRegression,
    "river, naive Bayes": naive_bayes.GaussianNB,
    "river, Hoeffding tree": tree.HoeffdingTreeClassifier,
    "scikit-learn, logistic by SGD": lambda: _one_by_one(
        SGDClassifier(loss="log_loss", random_state=0)
    ),
    "scikit-learn, perceptron": lambda: _one_by_one(Perceptron(random_state=0)),
}


def read_stream(stream: str) -> list[Example]:
    """Return all examples of a stream, each a vector and its label."""
    if stream == "digits":
        xs, ys = load_digits(return_X_y=True)
        return [(x, str(y)) for x, y in zip(xs, ys, strict=True)]
    if stream == "image segments":
        return [(np.array(list(x.values()), float), str(y)) for x, y in datasets.ImageSegments()]
    return [
        (_hashed(sentence), library)
        for library in _LIBRARIES
        for sentence in _sentences(library)[:_SENTENCES]
    ]


def _hashed(sentence: str) -> NDArray[np.float64]:
    """Return a text as a vector, whose elements are the square roots of the numbers of words with
    each hash."""
    vectorizer = HashingVectorizer(n_features=_N_HASHES, alternate_sign=False, norm=None)
    counts: NDArray[np.float64] = np.sqrt(vectorizer.transform([sentence]).toarray()[0])
    return counts


def _sentences(library: str) -> list[str]:
    """Return sentences of a library's documentation, without the library's name and without
    code."""
    texts: dict[str, None] = {}
    package = import_module(library)
    for found in sorted(pkgutil.iter_modules(package.__path__), key=lambda each: each.name):
        if found.name.startswith("_") or found.name in ("tests", "conftest", "testing", "f2py"):
            continue
        try:
            module = import_module(f"{library}.{found.name}")
        except ImportError:  # the module needs a library that is not installed
            continue
        for _, member in sorted(inspect.getmembers(module, callable), key=lambda pair: pair[0]):
            texts.update(dict.fromkeys(_of_text(inspect.getdoc(member) or "", library)))
    return list(texts)


def _of_text(text: str, library: str) -> Iterator[str]:
    for part in re.split(r"[.:]\s+|\n\s*\n", text):
        words = " ".join(part.split())
        if re.fullmatch(r"[A-Z][\w ,'()-]{40,300}", words) and library not in words.lower():
            yield words


ONLINE = Experiment(
    title="Streams beyond driving",
    text="Share of examples that were predicted correctly before they were learned. Digits: from "
    "scikit-learn, 64 pixels. Image segments: from river, 18 numbers. Text: the library "
    "(numpy, scikit-learn or river) whose documentation contains the sentence, by hashed "
    "words. Values are standardised online. All data is part of the libraries; seeds shuffle "
    "its order. In brackets: the 95 % interval of the mean (bootstrap).",
    plan=_plan,
    tables=_tables,
)
