"""Makes BSOC, this project's online classifier, available to the library river. Inputs are dicts,
which may have different features each time. Labels may be any hashable values."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from robot.errors import MissingExtraError
from robot.learner.classifier import GROUP_COST, N_VOTERS, BSOCClassifier

if TYPE_CHECKING:
    import pandas as pd

try:
    from river import base
except ImportError as error:
    raise MissingExtraError("BSOC for river", "learners") from error


class RiverBSOC(base.MiniBatchClassifier):  # type: ignore[misc]
    """An online classifier of at most `max_nodes` images.

    Scale the features first (`preprocessing.StandardScaler`), because distances are sums over
    features. A feature that is missing counts as 0.

    Parameters
    ----------
    max_nodes
        Maximum number of images to keep.
    n_voters
        Number of nearest images that vote.
    group_cost
        Factor by which merging images of different classes costs more.

    Examples
    --------
    >>> from robot.lab.adapters.for_river import RiverBSOC
    >>> model = RiverBSOC(max_nodes=4)
    >>> model.learn_one({"light": 0.9}, "day")
    >>> model.learn_one({"light": 0.1}, "night")
    >>> model.predict_one({"light": 0.8})
    'day'

    """

    _room = 16
    """Number of features that fit into a vector. The vector is enlarged to at least double its size
    when a new feature does not fit."""

    def __init__(
        self, max_nodes: int = 32, n_voters: int = N_VOTERS, group_cost: float = GROUP_COST
    ) -> None:
        self.max_nodes = max_nodes
        self.n_voters = n_voters
        self.group_cost = group_cost
        self._learner = BSOCClassifier(
            max_nodes, n_voters=n_voters, group_cost=group_cost, forgets=False
        )
        self._columns: dict[Hashable, int] = {}
        self._labels: dict[Hashable, int] = {}

    @property
    def _multiclass(self) -> bool:
        return True

    def learn_one(self, x: Mapping[Any, Any], y: Any) -> None:
        # Give the features a fixed order, so that their order in the dict does not matter.
        known, n = self._columns, len(self._columns)
        new = sorted((name for name in x if name not in known), key=repr)
        columns = known | {name: n + i for i, name in enumerate(new)} if new else known
        # Add a column to the stored examples for each new feature; its value was 0 in all of them.
        more = max(self._room, len(columns) - self._room)
        if len(columns) > self._room:
            self._room += more
            if self._learner.n_nodes_:
                state = self._learner.get_state()
                for name in ("cluster_images", "cluster_origin"):
                    longer = [(0, 0)] * (state.arrays[name].ndim - 1) + [(0, more)]
                    state.arrays[name] = np.pad(state.arrays[name], longer)
                self._learner.set_state(state)
        label = self._labels.get(y, len(self._labels))
        # store nothing before this call, because it may raise an error
        self._learner.learn_one(self._vector(x, columns), str(label))
        self._columns, self._labels[y] = columns, label

    def predict_proba_one(self, x: Mapping[Any, Any]) -> dict[Any, float]:
        """Return each label's share of the votes; empty before the first example."""
        if not self._labels:
            return {}
        shares = self._learner.predict_proba_one(self._vector(x, self._columns))
        return dict(zip(self._labels, shares.values(), strict=True))

    def learn_many(self, X: pd.DataFrame, y: pd.Series) -> None:  # noqa: N803 - river's name
        for row, label in zip(X.to_dict(orient="records"), y.tolist(), strict=True):
            self.learn_one(row, label)

    def predict_proba_many(self, X: pd.DataFrame) -> pd.DataFrame:  # noqa: N803
        # imported here, as in river, because only callers that pass data frames need pandas
        import pandas as pd

        rows = [self.predict_proba_one(row) for row in X.to_dict(orient="records")]
        return pd.DataFrame(rows, index=X.index, columns=list(self._labels))

    def _vector(self, x: Mapping[Any, Any], columns: Mapping[Any, int]) -> NDArray[np.float32]:
        """Return known features as a vector; features that were never learned are left out."""
        vector = np.zeros(self._room, np.float32)
        for name in x.keys() & columns.keys():
            vector[columns[name]] = x[name]
        return vector
