"""Learning again from recordings gives the same learner as driving, bit for bit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from robot.coaching.gallery import images
from robot.errors import ConfigurationError
from robot.moves import Move, names
from robot.policy.autosize import sample_frames
from robot.policy.events import HistoryEvent, Taught, describe_event
from robot.policy.history import TrainingHistory
from robot.policy.policy import Policy
from robot.policy.registry import make_policy
from robot.recordings.edits import Edit, Notes, trim
from robot.recordings.episode import Episode, open_episode
from robot.recordings.messages import Topic
from robot.recordings.teaching import learn_again, plan
from robot.recordings.writer import EpisodeWriter, describe_run
from robot.store.models.model import Model, same_nodes
from robot.types import Action, Example, Mode, Point

from .drives import RecordedBench, record_drive


def examples(episode: Episode, *edits: Edit) -> list[Example]:
    events = (step.event for step in plan([(episode, Notes(edits=edits))]))
    return [event.example for event in events if isinstance(event, Taught)]


def frames_taught(episode: Episode, *edits: Edit) -> list[int]:
    return [example.frame_id for example in examples(episode, *edits)]


LEARNERS = ("published-8", "default-8", "published-32", "default-32")


@pytest.mark.parametrize("learner", LEARNERS)
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
    robot.loop.submit(lambda: history.undo(0.2))
    robot.loop.submit(lambda: history.edit("pin", images(history.policy)[0].node_id, True))
    robot.loop.submit(lambda: history.undo_edit())
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


OWN = tuple(
    Move(Action(name), steering=steering, throttle=0.5)
    for name, steering in (("ahead", 0.0), ("port", -0.8), ("starboard", 0.8))
)


def record_own_moves(path: Path, learner: str, declared: tuple[Move, ...]) -> tuple[Policy, Path]:
    """Teach a body its own moves, sometimes proportionally; return the results."""
    policy, told = make_policy(learner, names(OWN)), list[HistoryEvent]()
    history = TrainingHistory(policy, told.extend, OWN)
    run = describe_run(
        episode_id=path.stem,
        run_id="r",
        origin_ns=0,
        learner=learner,
        moves=names(OWN),
        declared_moves=declared,
    )
    with path.open("xb") as file:
        writer = EpisodeWriter(file, run)
        for index, frame in enumerate(sample_frames(90)):
            seen, move = replace(frame, captured_s=index / 10), OWN[index // 12 % 3]
            point = move.point if index // 12 % 2 else None
            example = Example(
                frame_id=seen.frame_id, label=move.name, is_intervention=False, point=point
            )
            writer.write_frame(seen)
            history.teach(example, policy.extract(seen), seen.captured_s)
            told_last = describe_event(told[-1], with_vector=False)
            writer.write_message(Topic.LESSON, seen.captured_s, told_last)
        writer.close({"dropped_frames": "0", "lost_words": "0"})
    return policy, path


@pytest.mark.parametrize("learner", ["default-8", "default-32"])
def test_a_bodys_own_moves_are_learned_again_bit_for_bit(tmp_path: Path, learner: str) -> None:
    driven, path = record_own_moves(tmp_path / "a.mcap", learner, OWN)
    again = make_policy(learner, names(OWN))
    learn_again(again, [(open_episode(path), Notes())])
    assert same_nodes(again.get_state(), driven.get_state())
    assert (again.kinds.turns, again.kinds.points) == (driven.kinds.turns, driven.kinds.points)
    assert set(again.kinds.turns.values()) == {-1, 1}


def test_a_recording_without_declared_moves_removes_no_move_from_a_policy(tmp_path: Path) -> None:
    """A recording of 0.1, or of another program."""
    _, path = record_own_moves(tmp_path / "a.mcap", "default-8", ())
    going_on = make_policy("default-8", names(OWN))
    going_on.kinds.describe(OWN)
    turns = dict(going_on.kinds.turns)
    learn_again(going_on, [(open_episode(path), Notes())])
    assert going_on.kinds.turns == turns == {"port": -1, "starboard": 1}


def test_another_learner_learns_the_same_examples_if_it_has_their_moves(
    tmp_path: Path,
) -> None:
    episode = record_drive(tmp_path, "published-8")
    other = make_policy("default-16")
    report = learn_again(other, [(episode, Notes())])
    assert report.taught.total() == 60
    assert other.n_nodes == 16
    with pytest.raises(ConfigurationError, match="right"):
        learn_again(make_policy("published-8", (Action.FORWARD, Action.LEFT)), [(episode, Notes())])


def test_deleted_frames_are_not_learned(tmp_path: Path) -> None:
    episode = record_drive(tmp_path)
    ids = frames_taught(episode)
    deletion = Edit(verb="delete", ranges=((ids[10], ids[19]),))
    trimming = trim(episode.frames, ids[5], ids[14])
    assert frames_taught(episode, deletion) == ids[:10] + ids[20:]
    assert frames_taught(episode, deletion, trimming) == ids[5:10]


def test_relabelled_frames_are_learned_with_the_new_label_also_if_nobody_taught_them(
    tmp_path: Path,
) -> None:
    robot = RecordedBench(tmp_path)
    robot.drive(range(12))
    robot.drive(range(100, 110), Mode.AUTONOMOUS)
    episode = robot.episode()
    taught = frames_taught(episode)
    alone = [frame_id for frame_id in episode.frames if frame_id > taught[-1]][2:5]
    ranges = ((taught[0], taught[2]), (alone[0], alone[-1]))
    edit = Edit(verb="relabel", ranges=ranges, label=Action.RIGHT)
    assert frames_taught(episode, edit) == taught + alone
    labels = [example.label for example in examples(episode, edit)]
    before = [example.label for example in examples(episode)]
    assert labels == [Action.RIGHT] * 3 + before[3:] + [Action.RIGHT] * 3
