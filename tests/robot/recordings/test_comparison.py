"""Training before and after edits is compared on held-out frames, by the edited labels."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from robot.policy.policy import Policy
from robot.policy.registry import make_policy
from robot.recordings.comparison import FEWEST_FRAMES, compare
from robot.recordings.edits import Edit, Notes
from robot.recordings.episode import Episode
from robot.recordings.teaching import count_steps
from robot.types import Action
from tests.kit.sizes import few
from tests.robot.exchange.imported import import_pictures

MOVES = (Action.FORWARD, Action.LEFT)


def record(path: Path, labels: Sequence[Action], shown: Sequence[Action] | None = None) -> Episode:
    """Record pictures that are bright on the left where left is the right move."""
    noise = np.random.default_rng(len(labels))
    pictures = noise.integers(0, 60, (len(labels), 120, 160, 3), dtype=np.uint8)
    for pixels, truth in zip(pictures, shown or labels, strict=True):
        half = slice(0, 80) if truth is Action.LEFT else slice(80, 160)
        pixels[:, half] += 150
    return import_pictures(path, pictures, labels, moves=MOVES)


def new_policy() -> Policy:
    return make_policy("default-16", MOVES)


def alternating(n: int) -> list[Action]:
    return [MOVES[i // 20 % 2] for i in range(n)]


def test_without_edits_the_results_before_and_after_are_equal(tmp_path: Path) -> None:
    episode = record(tmp_path / "a.mcap", alternating(200))
    found = compare([(episode, Notes())], new_policy)
    assert found is not None
    assert (found.before, found.mended, found.broken) == (found.after, (), ())
    assert 30 <= found.frames <= 50


@pytest.mark.parametrize(
    ("first", "size"), few([(37, 40), (0, 40), (120, 40), (20, 160), (40, 160)], 2)
)
def test_a_repair_never_makes_it_worse_and_a_large_one_shows(
    tmp_path: Path, first: int, size: int
) -> None:
    truth, spoiled = alternating(200), alternating(200)
    for i in range(first, first + size):
        spoiled[i] = MOVES[truth[i] is Action.FORWARD]
    episode, notes = record(tmp_path / "a.mcap", spoiled, shown=truth), Notes()
    for frame_id, label in list(zip(episode.frames, truth, strict=True))[first : first + size]:
        edit = Edit(verb="relabel", ranges=((frame_id, frame_id),), label=label)
        notes = notes.with_edit(edit)
    steps: list[None] = []
    found = compare([(episode, notes)], new_policy, lambda: steps.append(None))
    assert found is not None
    assert found.after >= found.before
    if size > 100:
        assert found.after > found.before and found.mended
    assert {d.label for d in found.mended} == {d.after for d in found.mended}
    assert 300 <= len(steps) <= count_steps([(episode, Notes())]) + count_steps([(episode, notes)])


def test_with_too_few_examples_there_is_no_comparison(tmp_path: Path) -> None:
    for n in (2, FEWEST_FRAMES - 1):
        episode = record(tmp_path / f"{n}.mcap", alternating(n))
        assert compare([(episode, Notes())], new_policy) is None


def test_frames_that_are_compared_were_taught_to_neither_learner(tmp_path: Path) -> None:
    mended = [(record(tmp_path / f"{n}.mcap", alternating(n)), Notes()) for n in (100, 140)]
    made: list[Policy] = []

    def counted() -> Policy:
        made.append(new_policy())
        return made[-1]

    found = compare(mended, counted)
    assert found is not None
    assert [policy.n_seen for policy in made] == [240 - found.frames] * 2
