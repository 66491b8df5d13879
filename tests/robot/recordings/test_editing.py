"""A recording with its edits: the data of each picture, and copies with the edits applied."""

from __future__ import annotations

import random
from functools import partial
from pathlib import Path

import pytest

from robot.coaching.gallery import images
from robot.policy.history import Edited
from robot.policy.registry import make_policy
from robot.recordings.editing import EpisodeFrame, moments
from robot.recordings.edits import Edit, Notes
from robot.recordings.episode import open_episode
from robot.recordings.store import EpisodeStore
from robot.recordings.teaching import learn_again, plan
from robot.store.folder import Storage
from robot.store.models.model import same_nodes
from robot.types import Action, Mode
from tests.kit.sizes import crossed, few, seeds

from .drives import MOVES, RecordedBench, record_drive


def drive_and_edit_an_image(robot: RecordedBench, scenes: range, chance: random.Random) -> None:
    """Teach, and halfway relabel a learned image, as a person does."""
    history = robot.loop.history
    robot.start(Mode.TRAIN, scenes.start)
    for scene in scenes:
        robot.step(scene, MOVES[scene // 4 % 3])
        if scene == scenes[len(scenes) // 2]:
            node, label = chance.choice(images(history.policy)).node_id, chance.choice(MOVES)
            robot.loop.submit(partial(history.edit, "relabel", node, label))
    robot.stop()


def learned(store: EpisodeStore, *names: str) -> tuple[object, int]:
    """Learn recordings again; return the learner, and the number of edits left out."""
    policy = make_policy("default-8")
    report = learn_again(policy, [(store.open(name), store.notes(name)) for name in names])
    return policy.get_state(), report.left_out_edits


@pytest.mark.parametrize("seed", seeds(3, 8))
def test_compacting_teaches_the_same_also_where_images_were_edited(
    tmp_path: Path, seed: int
) -> None:
    """An edit of an image counts only if all pictures of the image are still there."""
    chance, storage = random.Random(seed), Storage(tmp_path)
    robot = RecordedBench(storage.folder("episodes"), "default-8")
    drive_and_edit_an_image(robot, range(40), chance)
    [name] = [path.stem for path in robot.finish()]
    store = EpisodeStore(storage)
    ids = list(store.open(name).frames)
    for _ in range(seed % 3):
        between = tuple(sorted(chance.sample(ids, 2)))
        verb, label = chance.choice((("delete", None), ("relabel", Action.LEFT)))
        store.edit(name, Edit(verb=verb, ranges=(between,), label=label))  # type: ignore[arg-type]
    before, left_out = learned(store, name)
    assert left_out == (seed % 3 > 0)
    store.compact(name)
    after, _ = learned(store, name)
    assert same_nodes(before, after)  # type: ignore[arg-type]


@pytest.mark.parametrize("between", ["nothing", "an edit", "an edit taken back"])
def test_what_a_recording_took_back_of_the_one_before_stays_taken_back(
    tmp_path: Path, between: str
) -> None:
    chance, storage = random.Random(1), Storage(tmp_path)
    robot = RecordedBench(storage.folder("episodes"), "default-8")
    history = robot.loop.history
    drive_and_edit_an_image(robot, range(40), chance)
    robot.stand(12)
    if between == "an edit taken back":
        drive_and_edit_an_image(robot, range(40, 60), chance)
        robot.loop.submit(history.undo_edit)
    robot.loop.submit(history.undo_edit)
    if between == "an edit":
        drive_and_edit_an_image(robot, range(40, 60), chance)
    else:
        robot.drive(range(60, 80))
    first, second = [path.stem for path in robot.finish()]
    store = EpisodeStore(storage)
    before, left_out = learned(store, first, second)
    assert same_nodes(before, history.policy.get_state())  # type: ignore[arg-type]
    store.compact(second)
    assert same_nodes(before, learned(store, first, second)[0])  # type: ignore[arg-type]
    assert left_out == 0


@crossed(way=["compact", "split", "split and compact"], taken_back=[1, 2])
def test_the_edit_of_an_image_that_is_taken_back_later_is_the_right_one(
    tmp_path: Path, taken_back: int, way: str
) -> None:
    """This also holds if that recording was edited, and rewritten or split."""
    chance, storage = random.Random(taken_back), Storage(tmp_path)
    robot = RecordedBench(storage.folder("episodes"), "default-8")
    for scenes in (range(40), range(40, 60)):
        drive_and_edit_an_image(robot, scenes, chance)
        robot.stand(12)
    for _ in range(taken_back):
        robot.loop.submit(robot.loop.history.undo_edit)
    robot.drive(range(60, 80))
    first, second, third = [path.stem for path in robot.finish()]
    store = EpisodeStore(storage)
    ids = list(store.open(second).frames)

    def left(*names: str) -> list[tuple[str, int]]:
        steps = plan([(store.open(name), store.notes(name)) for name in names])
        made = [
            (step.event.verb, step.event.node_id)
            for step in steps
            if isinstance(step.event, Edited)
        ]
        assert learned(store, *names)[1] == 0
        return made

    edit = Edit(verb="delete", ranges=((ids[2], ids[4]),))
    before, _ = left(first, second, third), store.edit(second, edit)
    state, _ = learned(store, first, second, third)
    names = [first, second, third]
    if "split" in way:
        names.insert(2, store.split(second, ids[10]))
    if "compact" in way:
        store.compact(second)
    assert left(*names) == before and len(before) == 2 - taken_back
    assert same_nodes(state, learned(store, *names)[0])  # type: ignore[arg-type]


def test_edits_of_images_apply_up_to_the_first_recording_that_was_edited(tmp_path: Path) -> None:
    chance, storage = random.Random(3), Storage(tmp_path)
    robot = RecordedBench(storage.folder("episodes"), "default-8")
    for scenes in (range(40), range(40, 60), range(60, 80)):
        drive_and_edit_an_image(robot, scenes, chance)
        robot.stand(12)
    names = [path.stem for path in robot.finish()]
    store = EpisodeStore(storage)
    ids = list(store.open(names[1]).frames)
    store.edit(names[1], Edit(verb="delete", ranges=((ids[2], ids[4]),)))
    before, left_out = learned(store, *names)
    assert left_out == 2
    store.compact(names[1])
    after, left_out = learned(store, *names)
    assert left_out == 2 and same_nodes(before, after)  # type: ignore[arg-type]


@pytest.mark.parametrize("share", few([0.1, 0.5, 0.8], 2))
def test_each_part_of_a_split_lasts_as_long_as_its_pictures(tmp_path: Path, share: float) -> None:
    storage = Storage(tmp_path)
    robot = RecordedBench(storage.folder("episodes"), "default-8")
    robot.drive(range(60))
    robot.stand(12)
    robot.start(Mode.AUTONOMOUS, 100)
    for scene in range(100, 240):
        robot.step(scene, None)
    robot.loop.submit(lambda: robot.loop.history.undo(0.2))  # of the recording before
    robot.tick()
    robot.stop()
    name = robot.finish()[1].stem
    store = EpisodeStore(storage)
    ids = list(store.open(name).frames)
    second = store.split(name, ids[int(share * len(ids))])
    store.compact(name)
    for part in (name, second):
        times_s = [entry.captured_s for entry in store.open(part).frames.values()]
        lasted_s = max(times_s) - min(times_s)
        assert lasted_s <= store.summary(part).duration_s <= lasted_s + 1.0
        assert store.open(part).duration_s == pytest.approx(store.summary(part).duration_s)


@pytest.mark.parametrize("length", few([1, 60, 62, 63, 64, 100], 3))
def test_a_recording_can_be_split_however_long_its_name(tmp_path: Path, length: int) -> None:
    storage = Storage(tmp_path)
    episode = record_drive(storage.folder("episodes"))
    name = "n" * length
    episode.path.rename(storage.folder("episodes") / f"{name}.mcap")
    store = EpisodeStore(storage)
    middle = list(episode.frames)[len(episode.frames) // 2]
    parts = {name, store.split(name, middle), store.split(name, list(episode.frames)[2])}
    assert parts == set(store.ids()) and len(parts) == 3


@pytest.mark.parametrize("every_s", few([0.02, 0.05, 0.1, 0.2, 0.5], 2))
def test_a_picture_of_a_standing_robot_has_nothing_of_the_next_drive(
    tmp_path: Path, every_s: float
) -> None:
    """For any camera rate, although the loop ticks twenty times a second."""
    robot = RecordedBench(tmp_path)

    def pass_time(seconds: float, held: Action | None) -> None:
        end_s = robot.clock.now_s() + seconds
        while robot.clock.now_s() < end_s - 1e-6:
            latest = robot.camera.latest()
            if latest is None or robot.clock.now_s() - latest.captured_s > every_s - 1e-6:
                robot.camera.show(round(robot.clock.now_s() * 50))
            robot.clock.sleep(min(every_s, 0.05))
            robot.hold(held)
            robot.tick()

    robot.start(Mode.TRAIN)
    drives_s = [[robot.clock.now_s()]]
    pass_time(3.0, Action.LEFT)
    robot.stop()
    drives_s[0].append(robot.clock.now_s())
    pass_time(5.0, None)
    robot.start(Mode.AUTONOMOUS, 1)
    drives_s.append([robot.clock.now_s()])
    pass_time(3.0, None)
    robot.stop()
    drives_s[1].append(robot.clock.now_s())
    episode = open_episode(robot.finish()[-1])

    def between(found: list[EpisodeFrame], first_s: float, last_s: float) -> list[EpisodeFrame]:
        return [each for each in found if first_s <= each.at_s + episode.start_s < last_s]

    found = list(moments(episode, Notes()))
    (_, stopped_s), (went_s, ended_s) = drives_s
    stood = between(found, stopped_s + 0.01, went_s - 0.5)
    drove = between(found, went_s, ended_s - 0.05)
    assert len(stood) >= 2 and len(drove) >= 3.0 / every_s - 2
    assert [(each.sent, each.driven_by) for each in stood] == [(None, None)] * len(stood)
    assert {each.driven_by for each in drove} == {"robot"}
    assert all(each.sent for each in drove) and all(each.distance_m for each in drove)


def test_a_picture_from_before_the_start_keeps_the_label_that_it_was_taught(tmp_path: Path) -> None:
    robot = RecordedBench(tmp_path)
    for scene in range(10):
        robot.clock.sleep(0.2)
        seen = robot.camera.show(scene)
        robot.tick()
    taken = robot.loop.set_mode(Mode.TRAIN)
    robot.tick()
    assert taken.result(0)
    robot.clock.sleep(0.2)
    robot.camera.show(10)
    robot.hold(Action.RIGHT, frame_id=seen.frame_id)
    robot.tick()
    robot.stop()
    episode = open_episode(robot.finish()[-1])
    labels = {each.frame_id: (each.label, each.sent) for each in moments(episode, Notes())}
    label, _ = labels.pop(seen.frame_id)
    assert label is Action.RIGHT
    assert {label for label, _ in labels.values()} == {None}
    sent = [sent for _, sent in labels.values()]
    assert sent[-1] == "right" and set(sent[:6]) == {None}
