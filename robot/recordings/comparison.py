"""Measures what a person's edits of recordings change: one learner is trained with the edits,
another one without.

Each recording is split into fifty stretches. Every fifth stretch is held out. Both learners are
trained on the other stretches, and tested on the held-out frames against the edited labels.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from robot.policy.events import Edited, Taught
from robot.policy.policy import Policy
from robot.recordings.edits import Notes
from robot.recordings.episode import Episode
from robot.recordings.teaching import EditedEpisode, Step, learn_again, plan
from robot.types import Action, Example

_STRETCHES = 50
_HELD_OUT = range(2, _STRETCHES, 5)
FEWEST_FRAMES = 50
"""Minimum number of labelled frames for a comparison. With fewer, the result is mostly chance."""
_SHOWN = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgedFrame:
    """A held-out frame for which only one of the two learners predicts the right move."""

    episode_id: str
    frame_id: int
    label: Action
    before: Action | None
    after: Action | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """The accuracy of each learner on held-out frames, and up to ten frames each that the edits
    corrected or broke."""

    frames: int
    before: float
    after: float
    mended: tuple[JudgedFrame, ...]
    broken: tuple[JudgedFrame, ...]


def compare(
    episodes: Sequence[EditedEpisode],
    new_policy: Callable[[], Policy],
    on_step: Callable[[], None] = lambda: None,
) -> Comparison | None:
    """Train one learner without the edits and one with them, and compare the two. Return None if
    the recordings have too few labelled frames."""
    asked = _held_out(episodes)
    if asked is None:
        return None
    spans = {(episode.id, example.frame_id) for episode, example in asked}

    def is_taught(step: Step) -> bool:
        event = step.event
        return isinstance(event, Edited) or (step.episode.id, event.example.frame_id) not in spans

    unedited = [(episode, Notes()) for episode, _ in episodes]
    before, after = new_policy(), new_policy()
    learn_again(before, unedited, only=is_taught, on_step=on_step)
    learn_again(after, episodes, only=is_taught, on_step=on_step)
    differences, right_before, right_after = [], 0, 0
    for episode, example in asked:
        frame_id, label = example.frame_id, example.label
        x = after.extract(episode.frame(frame_id))
        was = before.propose(frame_id, x).action
        now = after.propose(frame_id, x).action
        right_before += was == label
        right_after += now == label
        if (was == label) != (now == label):
            judged = JudgedFrame(
                episode_id=episode.id, frame_id=frame_id, label=label, before=was, after=now
            )
            differences.append(judged)
        on_step()
    return Comparison(
        frames=len(asked),
        before=right_before / len(asked),
        after=right_after / len(asked),
        mended=_spread([d for d in differences if d.after == d.label]),
        broken=_spread([d for d in differences if d.before == d.label]),
    )


def _held_out(episodes: Sequence[EditedEpisode]) -> list[tuple[Episode, Example]] | None:
    counts = Counter(id(episode) for episode, _ in _labelled(episodes))
    if counts.total() < FEWEST_FRAMES:
        return None
    ranks: Counter[int] = Counter()
    found: list[tuple[Episode, Example]] = []
    for episode, example in _labelled(episodes):
        own = id(episode)
        if _stretch_of(ranks[own], counts[own]) in _HELD_OUT:
            found.append((episode, example))
        ranks[own] += 1
    return found


def _labelled(episodes: Sequence[EditedEpisode]) -> Iterator[tuple[Episode, Example]]:
    for episode, event in plan(episodes):
        if isinstance(event, Taught) and event.example.frame_id in episode.frames:
            yield episode, event.example


def _stretch_of(rank: int, count: int) -> int:
    """Return the number of a frame's stretch. Stretch n begins at frame `count * n //
    _STRETCHES`."""
    return ((rank + 1) * _STRETCHES - 1) // count


def _spread(found: list[JudgedFrame]) -> tuple[JudgedFrame, ...]:
    step = max(1, -(-len(found) // _SHOWN))
    return tuple(found[::step])
