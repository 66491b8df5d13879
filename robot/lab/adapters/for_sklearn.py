"""A scikit-learn estimator that uses BSOC, this project's online classifier. It supports `fit`,
`partial_fit`, pipelines and `clone`."""

from __future__ import annotations

from copy import deepcopy
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot.errors import MissingExtraError
from robot.learner.classifier import GROUP_COST, N_VOTERS, BSOCClassifier
from robot.learner.ridge import RecursiveRidge

try:
    from sklearn.base import BaseEstimator, ClassifierMixin
    from sklearn.utils.multiclass import check_classification_targets, unique_labels
    from sklearn.utils.validation import check_is_fitted, validate_data
except ImportError as error:
    raise MissingExtraError("BSOC for scikit-learn (1.6 or newer)", "learners") from error


class BSOCEstimator(ClassifierMixin, BaseEstimator):  # type: ignore[misc]
    """An online classifier that stores at most `max_nodes` images as prototypes. A linear part, an
    online ridge regression, can be added.

    Scale the features to about [0, 1] or to variance 1 first, because distances are sums over
    features. Predictions do not change the learner, and may run on several threads.

    Args:
        max_nodes: Maximum number of images to keep.
        n_voters: Number of nearest images that vote.
        group_cost: Factor by which merging images of different classes costs more.
        penalty: Penalty of the linear part's squared coefficients; None means no linear part.

    Attributes:
        classes_: The classes, sorted, shape (n,).
        learner_: The learner. The learner's labels are the numbers of the classes, in order of
            appearance.
    """

    classes_: NDArray[Any]
    learner_: BSOCClassifier
    _are_all_named: bool
    _is_loaded = False

    def __init__(
        self,
        max_nodes: int = 32,
        *,
        n_voters: int = N_VOTERS,
        group_cost: float = GROUP_COST,
        penalty: float | None = None,
    ) -> None:
        self.max_nodes = max_nodes
        self.n_voters = n_voters
        self.group_cost = group_cost
        self.penalty = penalty

    def __setstate__(self, state: dict[str, Any]) -> None:
        super().__setstate__(state)
        self._is_loaded = True  # loaded arrays may be read-only, because of joblib's mmap_mode

    def fit(self, X: ArrayLike, y: ArrayLike) -> Self:  # noqa: N803 - scikit-learn's name
        """Forget everything, and learn these examples in order; X of shape (n, d), y of shape
        (n,)."""
        return self._learn(X, y, None, is_new=True)

    def partial_fit(self, X: ArrayLike, y: ArrayLike, classes: Any = None) -> Self:  # noqa: N803
        """Learn further examples.

        Args:
            X: Features, shape (n, d).
            y: Labels, shape (n,).
            classes: All classes, given in the first call or in every call. From the first call on,
                they fix the columns of `predict_proba`. Without this argument, classes that appear
                later are inserted in sorted order.

        Raises:
            ValueError: If a label is not among `classes`.
        """
        return self._learn(X, y, classes, is_new=not hasattr(self, "learner_"))

    def _learn(self, X: ArrayLike, y: ArrayLike, classes: Any, *, is_new: bool) -> Self:  # noqa: N803
        xs, ys = validate_data(self, X, y, reset=is_new)
        check_classification_targets(ys)
        given = unique_labels(ys if classes is None else classes)
        if not is_new and self._are_all_named:
            given = self.classes_ if classes is None else given
            if not np.array_equal(given, self.classes_):
                raise ValueError(
                    f"classes={given.tolist()} differ from the first call's, "
                    f"{self.classes_.tolist()}; pass the same classes again, or omit this argument"
                )
        if unknown := sorted(set(ys.tolist()) - set(given.tolist()), key=str):
            raise ValueError(
                f"y has labels that are not in classes: {unknown}; pass all classes in the first "
                "call of partial_fit"
            )
        if not is_new and self._is_loaded:
            self.learner_, self._is_loaded = deepcopy(self.learner_), False
        if is_new:
            linear = None
            if self.penalty is not None:
                linear = RecursiveRidge(xs.shape[1], penalty=self.penalty, scale=1.0)
            self.learner_ = BSOCClassifier(
                self.max_nodes,
                n_voters=self.n_voters,
                group_cost=self.group_cost,
                linear=linear,
                # the examples have no order, so a contradiction does not mean a change of mind
                forgets=False,
            )
            self._came: list[Any] = []
            self.classes_, self._are_all_named = given, classes is not None
        elif not self._are_all_named:
            self.classes_ = unique_labels(self.classes_, given)
        places = {label: place for place, label in enumerate(self._came)}
        for x, label in zip(xs, ys.tolist(), strict=True):
            place = places.setdefault(label, len(places))
            self.learner_.learn_one(x, str(place))  # raises ValueError if values are too large
            if place == len(self._came):
                self._came.append(label)
        return self

    def predict_proba(self, X: ArrayLike) -> NDArray[np.float64]:  # noqa: N803
        """Return the probability of each class, shape (n, classes), in the order of `classes_`."""
        check_is_fitted(self)
        xs = validate_data(self, X, reset=False)
        columns = np.searchsorted(self.classes_, np.asarray(self._came, self.classes_.dtype))
        shares = np.zeros((len(xs), len(self.classes_)))
        for row, x in zip(shares, xs, strict=True):
            row[columns] = list(self.learner_.predict_proba_one(x).values())
        return shares

    def predict(self, X: ArrayLike) -> NDArray[Any]:  # noqa: N803
        """Return the likeliest class of each row, shape (n,)."""
        check_is_fitted(self)
        found: NDArray[Any] = self.classes_[self.predict_proba(X).argmax(axis=1)]
        return found
