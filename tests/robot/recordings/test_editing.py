"""A recording with its edits: the data of each picture, and copies with the edits applied."""

from __future__ import annotations

import random
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from robot.coaching.gallery import images
from robot.policy.events import Edited
from robot.policy.registry import make_policy
from robot.recordings.editing import EpisodeFrame, moments
from robot.recordings.edits import Edit, Notes
from robot.recordings.store import EpisodeStore
from robot.recordings.teaching import learn_again, plan
from robot.store.folder import Storage
from robot.store.models.model import same_nodes
from robot.types import Action, Mode
from tests.kit.sizes import few, seeds

from .drives import MOVES, RecordedBench, record_drive


class Drives:
    """Drives in which learned images are edited, and the store of their recordings."""

    def __init__(self, folder: Path, seed: int = 1) -> None:
        storage = Storage(folder)
        self.chance, self.store = random.Random(seed), EpisodeStore(storage)
        self.robot = RecordedBench(storage.folder("episodes"), "default-8")
        self.history = self.robot.loop.history

    def drive_and_edit(self, *drives: range) -> None:
        """Teach, and relabel two learned images, as a person does; stand after each drive."""
        for scenes in drives:
            self.robot.start(Mode.TRAIN, scenes.start)
            for scene in scenes:
                self.robot.step(scene, MOVES[scene // 4 % 3])
                if scene in (scenes[len(scenes) // 2], scenes[-3]):
                    node = self.chance.choice(images(self.history.policy)).node_id
                    edit = partial(self.history.edit, "relabel", node, self.chance.choice(MOVES))
                    self.robot.loop.submit(edit)
            self.robot.stop()
            self.robot.stand(12)

    def undo_edit(self) -> None:
        self.robot.loop.submit(self.history.undo_edit)

    def names(self) -> list[str]:
        """End the recording, and return the names of all."""
        return [path.stem for path in self.robot.finish()]

    def ids(self, name: str) -> list[int]:
        return list(self.store.open(name).frames)

    def episodes(self, names: list[str]) -> list[Any]:
        return [(self.store.open(name), self.store.notes(name)) for name in names]

    def edits_of_images(self, names: list[str]) -> list[tuple[str, int]]:
        """Return the edits of images that learning again applies."""
        events = [step.event for step in plan(self.episodes(names))]
        return [(event.verb, event.node_id) for event in events if isinstance(event, Edited)]

    def learned(self, names: list[str]) -> tuple[Any, int]:
        """Learn recordings again; return the learner, and the number of edits left out."""
        policy = make_policy("default-8")
        report = learn_again(policy, self.episodes(names))
        return policy.get_state(), report.left_out_edits


@pytest.mark.parametrize("n_undone", [0, 1, 3])
@pytest.mark.parametrize("seed", seeds(3, 8))
def test_edits_of_images_and_their_undos_are_learned_again_also_from_rewritten_recordings(
    tmp_path: Path, seed: int, n_undone: int
) -> None:
    """Each drive is a recording, so an edit may be taken back in a later one than its own."""
    made = Drives(tmp_path, seed)
    made.drive_and_edit(range(40), range(40, 60))
    for _ in range(n_undone):
        made.undo_edit()
    made.drive_and_edit(*([range(60, 80)] if seed % 2 else []))
    made.robot.drive(range(80, 100))
    names = made.names()
    live, left_out = made.learned(names)
    assert same_nodes(live, made.history.policy.get_state()) and left_out == 0
    edits = made.edits_of_images(names)
    assert len(edits) == 4 + 2 * (seed % 2) - n_undone
    later = made.edits_of_images(names[2:])
    assert len(later) == 2 * (seed % 2), "learned alone, it takes back nothing of its own"

    edited, ids = names[1], made.ids(names[1])
    if seed % 3 == 0:
        made.store.edit(edited, Edit(verb="delete", ranges=((ids[2], ids[4]),)))
    elif seed % 3 == 1:
        relabel = Edit(verb="relabel", ranges=((ids[2], ids[-2]),), label=Action.LEFT)
        made.store.edit(edited, relabel)
    before, left_out = made.learned(names)
    n_later = max(2 - n_undone, 0) + 2 * (seed % 2)
    assert left_out == (n_later if seed % 3 < 2 else 0), "from the first edited recording on"
    if n_undone > 1:  # or else the split recording has an edit of an image, which is left out
        names.insert(2, made.store.split(edited, ids[10]))
    made.store.compact(edited)
    after, left_out_after = made.learned(names)
    assert same_nodes(before, after) and left_out_after == left_out
    assert made.edits_of_images(names) == edits


@pytest.mark.parametrize("share", few([0.1, 0.5, 0.8], 2))
def test_each_part_of_a_split_lasts_as_long_as_its_pictures(tmp_path: Path, share: float) -> None:
    made = Drives(tmp_path)
    made.robot.drive(range(60))
    made.robot.stand(12)
    made.robot.start(Mode.AUTONOMOUS, 100)
    for scene in range(100, 240):
        made.robot.step(scene, None)
    made.robot.undo(0.2)  # of the recording before
    made.robot.stop()
    name, ids = made.names()[1], made.ids(made.names()[1])
    second = made.store.split(name, ids[int(share * len(ids))])
    made.store.compact(name)
    for part in (name, second):
        times_s = [entry.captured_s for entry in made.store.open(part).frames.values()]
        lasted_s = max(times_s) - min(times_s)
        assert lasted_s <= made.store.summary(part).duration_s <= lasted_s + 1.0
        assert made.store.open(part).duration_s == pytest.approx(
            made.store.summary(part).duration_s
        )


@pytest.mark.parametrize("length", few([1, 60, 62, 63, 64, 100], 3))
def test_a_recording_can_be_split_however_long_its_name(tmp_path: Path, length: int) -> None:
    storage = Storage(tmp_path)
    episode = record_drive(storage.folder("episodes"))
    name, ids = "n" * length, list(episode.frames)
    episode.path.rename(storage.folder("episodes") / f"{name}.mcap")
    store = EpisodeStore(storage)
    parts = {name, store.split(name, ids[len(ids) // 2]), store.split(name, ids[2])}
    assert parts == set(store.ids()) and len(parts) == 3


@pytest.mark.parametrize("every_s", few([0.02, 0.05, 0.1, 0.2, 0.5], 2))
def test_a_picture_of_a_standing_robot_has_no_data_of_the_next_drive(
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

    times_s = []
    for mode, held in ((Mode.TRAIN, Action.LEFT), (Mode.AUTONOMOUS, None)):
        pass_time(5.0 if times_s else 0.0, None)
        robot.start(mode)
        times_s.append(robot.clock.now_s())
        pass_time(3.0, held)
        robot.stop()
        times_s.append(robot.clock.now_s())
    episode = robot.episode()

    def between(first_s: float, last_s: float) -> list[EpisodeFrame]:
        found = moments(episode, Notes())
        return [each for each in found if first_s <= each.at_s + episode.start_s < last_s]

    _, stopped_s, went_s, ended_s = times_s
    stood, drove = between(stopped_s + 0.01, went_s - 0.5), between(went_s, ended_s - 0.05)
    assert len(stood) >= 2 and len(drove) >= 3.0 / every_s - 2
    assert {(each.sent, each.driven_by) for each in stood} == {(None, None)}
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
    found = list(moments(robot.episode(), Notes()))
    assert {each.frame_id: each.label for each in found if each.label} == {
        seen.frame_id: Action.RIGHT
    }
    sent = [each.sent for each in found if each.frame_id != seen.frame_id]
    assert sent[-1] == "right" and set(sent[:6]) == {None}
