"""Which width of the band is best for all places but one? Each place is left out in turn.

python -m tests.robot.lab.choose_band ../shared/recordings [EXAMPLES]
"""

from __future__ import annotations

import sys
from unittest import mock

import numpy as np

from robot.lab.evaluation import Vectors, load_pairs, seen_by, teach
from robot.policy import recognition
from robot.policy.registry import make_policy

WIDTHS = (0.0, 0.5, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 4.0)


def errors(folder: str, examples: int | None) -> dict[str, np.ndarray]:
    """Return the mean error of the angle of each place's two pairs, by width: shape (2, widths)."""
    found: dict[str, list[list[float]]] = {}
    known: Vectors = {}
    for pair in load_pairs(folder):
        policy = make_policy("default-32")
        teach(policy, seen_by(policy, pair.train, known), examples)
        begun, test = policy.get_state(), seen_by(policy, pair.test, known)
        row = []
        for width in WIDTHS:
            policy.set_state(begun)
            policy.reset()
            with mock.patch.object(recognition, "BAND", width):
                said = [policy.propose(i + 1, x).point for i, (x, *_) in enumerate(test)]
            both = [
                (p.steering, t.steering) for p, (*_, t) in zip(said, test, strict=True) if p and t
            ]
            row.append(float(np.abs(np.subtract(*np.array(both).T)).mean()))
        found.setdefault(pair.place, []).append(row)
    return {place: np.array(rows) for place, rows in found.items()}


def main(folder: str, examples: int | None = None) -> None:
    by_place = errors(folder, examples)
    means = np.mean([rows.mean(axis=0) for rows in by_place.values()], axis=0)
    print("width " + " ".join(f"{width:6.2f}" for width in WIDTHS))
    print("error " + " ".join(f"{error:6.4f}" for error in means))
    held_out = []
    for place, rows in by_place.items():
        others = [other.mean(axis=0) for name, other in by_place.items() if name != place]
        best = int(np.mean(others, axis=0).argmin())
        held_out.append(rows.mean(axis=0)[best])
        print(f"without {place}: {WIDTHS[best]}; its own error then {held_out[-1]:.4f}")
    print(f"held-out error {np.mean(held_out):.4f}")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]) if sys.argv[2:] else None)
