"""Learning from recordings gives the same learner as driving, bit for bit, and edits change it.

The effect of edits is measured on held-out frames, with the edited labels."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from robot.coaching.gallery import images
from robot.errors import ConfigurationError
from robot.moves import Move, names
from robot.policy.events import Taught
from robot.policy.history import TrainingHistory
from robot.policy.policy import Policy
from robot.policy.registry import make_policy
from robot.policy.undo import undo_edit, undo_examples
from robot.recordings.comparison import FEWEST_FRAMES, compare
from robot.recordings.edits import Edit, Notes, trim
from robot.recordings.episode import Episode, open_episode, taught_frames
from robot.recordings.teaching import count_steps, learn_again, plan
from robot.store.models.model import Model, same_nodes
from robot.types import Action, Example, Mode, Point
from tests.kit.sizes import few
from tests.robot.exchange.imported import import_pictures

from .drives import RecordedBench, record_drive

LEARNERS = ("published-8", "default-8", "published-32", "default-32")
OWN = tuple(
    Move(Action(name), steering=steering, throttle=0.5)
    for name, steering in (("ahead", 0.0), ("port", -0.8), ("starboard", 0.8))
)


def examples(episode: Episode, *edits: Edit) -> list[Example]:
    events = (step.event for step in plan([(episode, Notes(edits=edits))]))
    return [event.example for event in events if isinstance(event, Taught)]


def frames_taught(episode: Episode, *edits: Edit) -> list[int]:
    return [example.frame_id for example in examples(episode, *edits)]


@pytest.mark.parametrize("learner", few(LEARNERS, 2))
def test_a_drive_with_corrections_and_undo_is_learned_again_bit_for_bit(
    tmp_path: Path, learner: str
) -> None:
    robot = RecordedBench(tmp_path, learner)
    history = robot.loop.history
    robot.drive(range(60))
    robot.undo(0.7)
    robot.start(Mode.AUTONOMOUS)
    for scene in range(200, 240):
        point = Point(0.3 + scene % 7 / 10, 0.3) if scene > 210 else None
        robot.step(scene, Action.RIGHT if scene % 9 < 3 else None, point=point)
    node = images(history.policy)[0].node_id
    robot.loop.submit(lambda: history.edit("relabel", node, Action.LEFT))
    robot.step(300, None)
    robot.loop.submit(lambda: undo_examples(history, 0.2))
    robot.loop.submit(lambda: history.edit("pin", images(history.policy)[0].node_id, True))
    robot.loop.submit(lambda: undo_edit(history))
    robot.step(301, Action.FORWARD)
    robot.stop()
    live = history.policy.get_state()
    episode = robot.episode()
    again = make_policy(learner)
    report = learn_again(again, [(episode, Notes())])
    assert same_nodes(again.get_state(), live)
    assert (report.taught, report.missing_frames) == (history.taught, 0)
    usual = again.usual_point(Action.RIGHT)
    assert usual is not None and usual == history.policy.usual_point(Action.RIGHT)
    after = episode.model_after()
    assert after is not None and same_nodes(after.state, live)


@pytest.mark.parametrize("learner", LEARNERS[:2])
def test_several_recordings_of_one_run_with_an_undo_across_them(
    tmp_path: Path, learner: str
) -> None:
    robot = RecordedBench(tmp_path, learner)
    robot.drive(range(30))
    robot.stand(12)
    robot.drive(range(30, 50))
    robot.undo(1.8)
    robot.drive(range(50, 70))
    live = robot.loop.history.policy.get_state()
    episodes = [(open_episode(path), Notes()) for path in robot.finish()]
    assert len(episodes) == 3
    again, before = make_policy(learner), episodes[-1][0].model_before()
    learn_again(again, episodes)
    assert isinstance(before, Model)
    going_on = before.to_policy()
    learn_again(going_on, episodes[-1:])
    assert same_nodes(again.get_state(), live) and same_nodes(going_on.get_state(), live)


def record_own_moves(path: Path, declared: tuple[Move, ...]) -> Episode:
    """Record a drive by a body's own moves, which the pilot sometimes steered proportionally."""
    driven = [OWN[index // 12 % 3] for index in range(90)]
    return import_pictures(
        path,
        np.random.default_rng(1).integers(0, 256, (90, 24, 32, 3), np.uint8),
        [move.name for move in driven],
        points=[move.point if index // 12 % 2 else None for index, move in enumerate(driven)],
        moves=names(OWN),
        declared_moves=declared,
    )


@pytest.mark.parametrize("learner", ["default-8", "default-32"])
def test_a_bodys_own_moves_are_learned_again_bit_for_bit(tmp_path: Path, learner: str) -> None:
    episode = record_own_moves(tmp_path / "a.mcap", OWN)
    driven, again = make_policy(learner, names(OWN)), make_policy(learner, names(OWN))
    history = TrainingHistory(driven, lambda events: None, OWN)
    for frame_id, example in taught_frames(episode).items():
        frame = episode.frame(frame_id)
        history.teach(example, driven.extract(frame), frame.captured_s)
    learn_again(again, [(episode, Notes())])
    assert same_nodes(again.get_state(), driven.get_state())
    assert (again.kinds.turns, again.kinds.points) == (driven.kinds.turns, driven.kinds.points)
    assert set(again.kinds.turns.values()) == {-1, 1}


def test_a_recording_without_declared_moves_removes_no_move_from_a_policy(tmp_path: Path) -> None:
    """A recording of version 0.1, or of another program."""
    episode = record_own_moves(tmp_path / "a.mcap", ())
    going_on = make_policy("default-8", names(OWN))
    going_on.kinds.describe(OWN)
    turns = dict(going_on.kinds.turns)
    learn_again(going_on, [(episode, Notes())])
    assert going_on.kinds.turns == turns == {"port": -1, "starboard": 1}


def test_another_learner_learns_the_same_examples_if_it_has_their_moves(tmp_path: Path) -> None:
    episode = record_drive(tmp_path, "published-8")
    other = make_policy("default-16")
    report = learn_again(other, [(episode, Notes())])
    assert report.taught.total() == 60
    assert other.n_nodes == 16
    with pytest.raises(ConfigurationError, match="right"):
        learn_again(make_policy("published-8", (Action.FORWARD, Action.LEFT)), [(episode, Notes())])


def test_deleted_frames_are_not_learned_but_relabelled_ones_are_even_if_never_taught(
    tmp_path: Path,
) -> None:
    robot = RecordedBench(tmp_path)
    robot.drive(range(12))
    robot.drive(range(100, 110), Mode.AUTONOMOUS)
    episode = robot.episode()
    taught = frames_taught(episode)
    deletion = Edit(verb="delete", ranges=((taught[5], taught[8]),))
    assert frames_taught(episode, deletion) == taught[:5] + taught[9:]
    trimming = trim(episode.frames, taught[3], taught[6])
    assert frames_taught(episode, deletion, trimming) == taught[3:5]
    alone = [frame_id for frame_id in episode.frames if frame_id > taught[-1]][2:5]
    ranges = ((taught[0], taught[2]), (alone[0], alone[-1]))
    edit = Edit(verb="relabel", ranges=ranges, label=Action.RIGHT)
    assert frames_taught(episode, edit) == taught + alone
    labels = [example.label for example in examples(episode, edit)]
    before = [example.label for example in examples(episode)]
    assert labels == [Action.RIGHT] * 3 + before[3:] + [Action.RIGHT] * 3


# Compared ----------------------------------------------------------------------------------------

MOVES = (Action.FORWARD, Action.LEFT)


def record(path: Path, labels: Sequence[Action], shown: Sequence[Action] | None = None) -> Episode:
    """Record pictures that are bright on the left where turning left is correct."""
    noise = np.random.default_rng(len(labels))
    pictures = noise.integers(0, 60, (len(labels), 120, 160, 3), dtype=np.uint8)
    for pixels, truth in zip(pictures, shown or labels, strict=True):
        half = slice(0, 80) if truth is Action.LEFT else slice(80, 160)
        pixels[:, half] += 150
    return import_pictures(path, pictures, labels, moves=MOVES)


def alternating(n: int) -> list[Action]:
    return [MOVES[i // 20 % 2] for i in range(n)]


@pytest.mark.parametrize("n_wrong", few([0, 40, 160], 2))
def test_a_repair_never_makes_it_worse_and_a_large_one_shows(tmp_path: Path, n_wrong: int) -> None:
    truth, spoiled = alternating(200), alternating(200)
    spoiled[20 : 20 + n_wrong] = [MOVES[move is Action.FORWARD] for move in truth[20:][:n_wrong]]
    episode, notes = record(tmp_path / "a.mcap", spoiled, shown=truth), Notes()
    for frame_id, label in list(zip(episode.frames, truth, strict=True))[20 : 20 + n_wrong]:
        edit = Edit(verb="relabel", ranges=((frame_id, frame_id),), label=label)
        notes = notes.with_edit(edit)
    steps: list[None] = []
    made: list[Policy] = []

    def new_policy() -> Policy:
        made.append(make_policy("default-16", MOVES))
        return made[-1]

    found = compare([(episode, notes)], new_policy, lambda: steps.append(None))
    assert found is not None and 30 <= found.frames <= 50
    assert found.after >= found.before
    if n_wrong == 0:
        assert (found.before, found.mended, found.broken) == (found.after, (), ())
    if n_wrong == 160:
        assert found.after > found.before and found.mended
    assert {d.label for d in found.mended} == {d.after for d in found.mended}
    assert 300 <= len(steps) <= count_steps([(episode, Notes())]) + count_steps([(episode, notes)])
    n_taught = [policy.n_seen for policy in made]
    assert n_taught == [200 - found.frames] * 2, "neither learner was taught these frames"


def test_with_too_few_examples_there_is_no_comparison(tmp_path: Path) -> None:
    for n in (2, FEWEST_FRAMES - 1):
        episode = record(tmp_path / f"{n}.mcap", alternating(n))
        assert compare([(episode, Notes())], lambda: make_policy("default-16", MOVES)) is None
