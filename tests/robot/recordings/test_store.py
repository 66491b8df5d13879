"""Episodes on disk: listed in any state, edited, deleted, restored, compacted."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from robot.errors import ConfigurationError, NotFoundError, RecordingError
from robot.policy.events import Taught
from robot.policy.registry import make_policy
from robot.recordings.editing import moments, sample, write_edited
from robot.recordings.edits import Edit, Notes, notes_path, trim, write_notes
from robot.recordings.episode import taught_frames
from robot.recordings.store import EpisodeStore
from robot.recordings.teaching import learn_again, plan
from robot.store.folder import Storage
from robot.store.lock import FolderLock
from robot.store.models.model import same_nodes
from robot.types import Action, Mode

from .drives import RecordedBench, record_drive


@pytest.fixture
def storage(tmp_path: Path) -> Storage:
    return Storage(tmp_path / "data")


@pytest.fixture
def store(storage: Storage) -> EpisodeStore:
    """A store of one recording of 60 lessons."""
    record_drive(storage.folder("episodes"))
    return EpisodeStore(storage)


@pytest.fixture
def name(store: EpisodeStore) -> str:
    return store.ids()[0]


def test_an_invalid_title_is_kept_as_far_as_it_is_text(store: EpisodeStore, name: str) -> None:
    for title in ("Fl\udcfcr", "\ud83d", "Küche"):
        store.set_title(name, title)
        assert store.notes(name).title == title.encode(errors="replace").decode()


def test_a_list_shows_what_an_episode_holds_without_reading_it_all(store: EpisodeStore) -> None:
    [summary] = store.summaries()
    episode = store.open(summary.id)
    assert summary.damage is None and summary.is_readable
    assert summary.frames == len(episode.frames)
    assert dict(summary.taught) == {"forward": 20, "left": 20, "right": 20}
    assert summary.duration_s == pytest.approx(episode.duration_s, abs=0.01)
    assert summary.started_at_s == pytest.approx(episode.origin_ns / 1e9 + 100, abs=5)


def test_labels_predictions_and_drivers_stand_beside_each_picture(
    store: EpisodeStore, name: str
) -> None:
    episode = store.open(name)
    found = list(moments(episode, Notes()))
    taught = [moment for moment in found if moment.label]
    assert len(taught) == 60
    assert taught[0].label is Action.FORWARD and taught[4].label is Action.LEFT
    assert {moment.driven_by for moment in taught[1:]} == {"pilot"}
    assert all(moment.predicted for moment in taught[2:])
    assert sample(episode, Notes(), 10**6) == found
    between = found[7].frame_id, found[20].frame_id
    assert sample(episode, Notes(), 10**6, between) == found[7:21]


def test_edits_are_kept_beside_the_file_and_can_all_be_undone(
    store: EpisodeStore, name: str
) -> None:
    path = store.path(name)
    before = path.read_bytes()
    ids = list(store.open(name).frames)
    store.edit(name, Edit(verb="delete", ranges=((ids[5], ids[9]),)))
    store.edit(name, Edit(verb="relabel", ranges=((ids[0], ids[20]),), label=Action.RIGHT))
    store.set_title(name, "  Flur, abends ")
    store.protect(name, True)
    notes = EpisodeStore(Storage(path.parent.parent)).notes(name)
    assert (notes.title, notes.is_protected, len(notes.edits)) == ("Flur, abends", True, 2)
    assert sum(map(notes.is_deleted, ids)) == 5
    assert path.read_bytes() == before
    for _ in range(2):
        store.undo_edit(name)
    assert store.notes(name).edits == ()
    with pytest.raises(ConfigurationError, match="nothing to undo"):
        store.undo_edit(name)


def test_compacting_applies_the_edits_and_teaches_the_same(store: EpisodeStore, name: str) -> None:
    ids = list(store.open(name).frames)
    store.edit(name, trim(ids, ids[5], ids[-5]))
    store.edit(name, Edit(verb="relabel", ranges=((ids[10], ids[20]),), label=Action.RIGHT))
    before, after, size = (
        make_policy("default-8"),
        make_policy("default-8"),
        store.summary(name).bytes,
    )
    learn_again(before, [(store.open(name), store.notes(name))])
    undo = store.compact(name)
    assert store.summary(name).bytes < size
    assert store.notes(name).edits == ()
    learn_again(after, [(store.open(name), Notes())])
    assert same_nodes(after.get_state(), before.get_state())
    assert len(store.open(name).frames) == len(ids) - 9

    assert store.restore(undo) == [f"{name} (2)"]
    assert len(store.notes(f"{name} (2)").edits) == 2
    assert len(store.open(f"{name} (2)").frames) == len(ids)


def test_a_compact_recording_knows_what_corrected_the_robot(storage: Storage) -> None:
    robot = RecordedBench(storage.folder("episodes"), "default-8")
    robot.drive(range(20))
    robot.start(Mode.AUTONOMOUS)
    for scene in range(100, 120):
        robot.step(scene, Action.RIGHT if scene % 5 < 2 else None)
    [path] = robot.finish()
    store = EpisodeStore(storage)

    def corrections() -> list[int]:
        steps = plan([(store.open(path.stem), store.notes(path.stem))])
        examples = [step.event.example for step in steps if isinstance(step.event, Taught)]
        return [example.frame_id for example in examples if example.is_intervention]

    before = corrections()
    store.edit(path.stem, Edit(verb="delete", ranges=((before[0], before[0]),)))
    store.compact(path.stem)
    assert len(before) > 3
    assert corrections() == before[1:]


def test_notes_of_a_recording_that_is_gone_edit_no_new_one(store: EpisodeStore) -> None:
    path = store.new_path("tub")
    write_notes(path, Notes(edits=(Edit(verb="delete", ranges=((1, 9),)),)))
    assert path.name == "tub.mcap" and store.new_path("Tub").name == "Tub (2).mcap"


def test_a_recording_of_another_program_in_progress_is_not_touched(
    storage: Storage, store: EpisodeStore
) -> None:
    robot = RecordedBench(storage.folder("episodes"))
    with FolderLock(storage.root):
        robot.drive(range(20))
        robot.stand(1.0)
        episode_id, done = store.ids()
        for refused in (store.delete, store.compact):
            with pytest.raises(ConfigurationError, match=r"not finished: another drivelesson \("):
                refused(episode_id)
        store.compact(done)
        robot.drive(range(20, 60))
        robot.finish()
        assert store.summary(episode_id).taught == {"forward": 20, "left": 20, "right": 20}
        store.delete(episode_id)


def test_a_recording_that_was_cut_short_is_no_longer_in_progress(
    store: EpisodeStore, name: str
) -> None:
    path = store.path(name)
    path.write_bytes(path.read_bytes()[:-1])
    store.compact(name)
    path.write_bytes(path.read_bytes()[:3])
    store.delete(name)


def test_edits_made_during_compacting_are_not_lost(
    storage: Storage, store: EpisodeStore, name: str
) -> None:
    other, path, ids = EpisodeStore(storage), store.path(name), list(store.open(name).frames)
    changes: list[Callable[[], object]] = [
        lambda: other.edit(name, trim(ids, ids[5], ids[-5])),
        lambda: path.write_bytes(path.read_bytes() + b" "),
        lambda: other.delete(name),
    ]
    for change in changes:

        def write_slowly(*what: Any, change: Callable[[], object] = change, **how: Any) -> None:
            write_edited(*what, **how)
            change()

        with pytest.raises((ConfigurationError, NotFoundError)):
            EpisodeStore(storage, write=write_slowly).compact(name)
    assert len(store.notes(name).edits) == 1 and store.ids() == [name]


def test_beyond_the_budget_the_oldest_unprotected_are_offered_and_none_is_deleted(
    storage: Storage,
) -> None:
    ids = [record_drive(storage.folder("episodes"), frames=20).id for _ in range(4)]
    store = EpisodeStore(storage)
    store.protect(ids[0], True)
    size = store.summary(ids[0]).bytes
    store.budget_bytes = size * 5 // 2
    assert [summary.id for summary in store.offered()] == ids[1:3]
    assert len(store.ids()) == 4
    store.budget_bytes = size * 10
    assert store.offered() == []


@pytest.mark.parametrize(
    "strange",
    [
        *("../x", "..", "/etc/passwd", "", "a/../b", "a/b", "a\\b", ".index"),
        *("\ud83d", "\udcff", "x" * 10_000, "a\0b"),
    ],
)
def test_a_strange_name_is_not_found_and_leads_nowhere(store: EpisodeStore, strange: str) -> None:
    reading, writing = (store.summary, store.open, store.notes), (store.delete, store.compact)
    for attempt in (*reading, *writing, store.restore):
        with pytest.raises(NotFoundError):
            attempt(strange)


@pytest.mark.parametrize("damaged", [b"{", b"\xf4", b"", b"[]", b'{"edits": 1}', b" " * 2**25])
def test_damaged_notes_are_named_and_hide_no_episode(
    store: EpisodeStore, name: str, damaged: bytes
) -> None:
    notes_path(store.path(name)).write_bytes(damaged)
    assert "edits.json is damaged" in str(store.summary(name).damage)
    assert len(taught_frames(store.open(name))) == 60
    with pytest.raises(RecordingError, match="damaged"):
        store.set_title(name, "x")
