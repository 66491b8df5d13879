"""The data of each picture after a recording's edits, and copies with the edits applied."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import pytest

from robot.coaching.gallery import images
from robot.policy.events import Edited
from robot.policy.registry import make_policy
from robot.policy.undo import undo_edit
from robot.recordings.editing import EpisodeFrame, moments
from robot.recordings.edits import Edit, Notes
from robot.recordings.store import EpisodeStore
from robot.recordings.teaching import learn_again, plan
from robot.store.folder import Storage
from robot.store.models.model import same_nodes
from robot.types import Action, Mode
from tests.kit.sizes import crossed, few, seeds

from .drives import MOVES, RecordedBench, record_drive


@pytest.fixture
def store(tmp_path: Path) -> EpisodeStore:
    return EpisodeStore(Storage(tmp_path))


@pytest.fixture
def robot(tmp_path: Path) -> RecordedBench:
    """A bench robot that records into the folder of the fixture `store`."""
    return RecordedBench(Storage(tmp_path).folder("episodes"), "default-8")


def drive_and_edit(robot: RecordedBench, scenes: range, chance: random.Random) -> None:
    """Teach, relabel two learned images like a person, and then stand."""
    history = robot.loop.history
    robot.start(Mode.TRAIN, scenes.start)
    for scene in scenes:
        robot.step(scene, MOVES[scene // 4 % 3])
        if scene in (scenes[len(scenes) // 2], scenes[-3]):
            node, label = chance.choice(images(history.policy)).node_id, chance.choice(MOVES)
            robot.loop.submit(lambda n=node, to=label: history.edit("relabel", n, to))
    robot.stop()
    robot.stand(12)


@crossed(seed=seeds(3, 8), n_undone=[0, 1, 3])
def test_edits_of_images_and_their_undos_are_learned_again_also_from_rewritten_recordings(
    store: EpisodeStore, robot: RecordedBench, seed: int, n_undone: int
) -> None:
    """Each drive is a recording, so an edit may be undone in a later recording."""
    chance, history = random.Random(seed), robot.loop.history

    def learned(names: list[str]) -> tuple[Any, int, list[tuple[str, int]]]:
        """Learn these recordings; return the learner, the number of skipped edits, and edits."""
        policy = make_policy("default-8")
        episodes = [(store.open(name), store.notes(name)) for name in names]
        report = learn_again(policy, episodes)
        events = [step.event for step in plan(episodes)]
        edits = [(event.verb, event.node_id) for event in events if isinstance(event, Edited)]
        return policy.get_state(), report.left_out_edits, edits

    for scenes in (range(40), range(40, 60)):
        drive_and_edit(robot, scenes, chance)
    for _ in range(n_undone):
        robot.loop.submit(lambda: undo_edit(history))
    if seed % 2:
        drive_and_edit(robot, range(60, 80), chance)
    robot.drive(range(80, 100))
    names = [path.stem for path in robot.finish()]
    live, left_out, edits = learned(names)
    assert same_nodes(live, history.policy.get_state()) and left_out == 0
    assert len(edits) == 4 + 2 * (seed % 2) - n_undone
    later = learned(names[2:])[2]
    assert len(later) == 2 * (seed % 2), "a part of the history undoes no earlier edit"

    edited, ids = names[1], list(store.open(names[1]).frames)
    if seed % 3 == 0:
        store.edit(edited, Edit(verb="delete", ranges=((ids[2], ids[4]),)))
    elif seed % 3 == 1:
        relabel = Edit(verb="relabel", ranges=((ids[2], ids[-2]),), label=Action.LEFT)
        store.edit(edited, relabel)
    before, left_out, _ = learned(names)
    n_later = max(2 - n_undone, 0) + 2 * (seed % 2)
    assert left_out == (n_later if seed % 3 < 2 else 0), "later edits of images are left out"
    if n_undone > 1:  # otherwise an edit of an image is left out
        names.insert(2, store.split(edited, ids[10]))
    store.compact(edited)
    after, left_out_after, edits_after = learned(names)
    assert same_nodes(before, after) and (left_out_after, edits_after) == (left_out, edits)


def test_a_compact_recording_knows_what_corrected_the_robot(
    store: EpisodeStore, robot: RecordedBench
) -> None:
    robot.drive(range(20))
    robot.start(Mode.AUTONOMOUS)
    for scene in range(100, 120):
        robot.step(scene, Action.RIGHT if scene % 5 < 2 else None)
    [path] = robot.finish()

    def corrections() -> list[int]:
        found = moments(store.open(path.stem), store.notes(path.stem))
        return [each.frame_id for each in found if each.is_intervention and not each.is_deleted]

    before = corrections()
    store.edit(path.stem, Edit(verb="delete", ranges=((before[0], before[0]),)))
    store.compact(path.stem)
    assert len(before) > 3
    assert corrections() == before[1:]


def test_each_part_of_a_split_lasts_as_long_as_its_pictures(
    store: EpisodeStore, robot: RecordedBench
) -> None:
    robot.drive(range(60))
    robot.stand(12)
    robot.start(Mode.AUTONOMOUS, 100)
    for scene in range(100, 240):
        robot.step(scene, None)
    robot.undo(0.2)  # an undo of an example in the previous recording
    robot.stop()
    name = robot.finish()[1].stem
    ids = list(store.open(name).frames)
    second = store.split(name, ids[len(ids) // 3])
    store.compact(name)
    for part in (name, second):
        times_s = [entry.captured_s for entry in store.open(part).frames.values()]
        lasted_s = max(times_s) - min(times_s)
        assert lasted_s <= store.summary(part).duration_s <= lasted_s + 1.0
        assert store.open(part).duration_s == pytest.approx(store.summary(part).duration_s)


@pytest.mark.parametrize("length", few([1, 60, 62, 63, 64, 100], 3))
def test_a_recording_can_be_split_however_long_its_name(
    store: EpisodeStore, tmp_path: Path, length: int
) -> None:
    episode = record_drive(tmp_path / "episodes")
    name, ids = "n" * length, list(episode.frames)
    episode.path.rename(episode.path.with_stem(name))
    parts = {name, store.split(name, ids[len(ids) // 2]), store.split(name, ids[2])}
    assert parts == set(store.ids()) and len(parts) == 3


@pytest.mark.parametrize("every_s", few([0.02, 0.05, 0.1, 0.2, 0.5], 2))
def test_a_picture_of_a_standing_robot_has_no_data_of_the_next_drive(
    robot: RecordedBench, every_s: float
) -> None:
    """The camera's period may be shorter or longer than the loop's, which is 50 ms."""

    def pass_time(seconds: float, held: Action | None) -> None:
        end_s = robot.clock.now_s() + seconds
        while robot.clock.now_s() < end_s - 1e-6:
            latest = robot.camera.latest()
            if latest is None or robot.clock.now_s() - latest.captured_s > every_s - 1e-6:
                robot.camera.show(round(robot.clock.now_s() * 50))
            robot.clock.sleep(min(every_s, 0.05))
            robot.hold(held)
            robot.tick()

    times_s = []
    for mode, held in ((Mode.TRAIN, Action.LEFT), (Mode.AUTONOMOUS, None)):
        pass_time(2.5 if times_s else 0.0, None)
        robot.start(mode)
        times_s.append(robot.clock.now_s())
        pass_time(1.5, held)
        robot.stop()
        times_s.append(robot.clock.now_s())
    episode = robot.episode()

    def between(first_s: float, last_s: float) -> list[EpisodeFrame]:
        found = moments(episode, Notes())
        return [each for each in found if first_s <= each.at_s + episode.start_s < last_s]

    _, stopped_s, went_s, ended_s = times_s
    stood, drove = between(stopped_s + 0.01, went_s - 0.5), between(went_s, ended_s - 0.05)
    assert len(stood) >= 2 and len(drove) >= 1.5 / every_s - 2
    assert {(each.sent, each.driven_by) for each in stood} == {(None, None)}
    assert {each.driven_by for each in drove} == {"robot"}
    assert all(each.sent for each in drove) and all(each.distance_m for each in drove)


def test_a_picture_from_before_the_start_keeps_the_label_that_it_was_taught(
    robot: RecordedBench,
) -> None:
    for scene in range(10):
        robot.clock.sleep(0.2)
        seen = robot.camera.show(scene)
        robot.tick()
    robot.loop.set_mode(Mode.TRAIN)
    robot.tick()
    robot.clock.sleep(0.2)
    robot.camera.show(10)
    robot.hold(Action.RIGHT, frame_id=seen.frame_id)
    robot.tick()
    robot.stop()
    episode = robot.episode()
    found = list(moments(episode, Notes()))
    assert [(e.frame_id, e.label) for e in found if e.label] == [(seen.frame_id, Action.RIGHT)]
    assert episode.frame(seen.frame_id).data == seen.data
    sent = [each.sent for each in found if each.frame_id != seen.frame_id]
    assert sent[-1] == "right" and set(sent[:6]) == {None}
