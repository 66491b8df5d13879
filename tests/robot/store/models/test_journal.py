"""After any kills, damage and full disks, written changes exist and undone changes do not."""

from __future__ import annotations

import asyncio
import os
import random
import shutil
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from robot.clock import RealClock
from robot.coaching.gallery import images
from robot.moves import Move
from robot.store.disk import DiskThread
from robot.store.folder import Storage
from robot.store.models.journal_writer import PART_BYTES, list_parts
from robot.store.models.recovery import recover
from robot.store.models.store import ModelStore
from robot.store.records import RecordWriter, frame_record, read_records
from robot.types import Action
from tests.kit.sizes import crossed, seeds, size
from tests.learners import installed

from .lives import Life, same

SEEDS = size("LIVES", 100, 1_000) // 10
OPS = ("teach",) * 6 + ("undo", "edit", "undo_edit", "save", "begin", "load") + ("write",) * 4
DAMAGE = ("flip", "cut", "empty", "remove", "folder", "dangling", "loop", "fifo", "none")


@pytest.fixture(autouse=True)
def _no_waiting(monkeypatch):
    monkeypatch.setattr(os, "fsync", lambda handle: None)
    yield
    while Life.all:
        Life.all.pop().die()


def damage(folder: Path, rng: random.Random) -> str:
    """Damage one stored file in a realistic way; return a description."""
    found = [*folder.glob("journal/*"), *folder.glob("models/*/*"), folder / "models/current.txt"]
    files = sorted(path for path in found if path.is_file() and not path.is_symlink())
    how = rng.choice(DAMAGE)
    if not files or how == "none":
        return "none"
    path = rng.choice(files)
    data = bytearray(path.read_bytes())
    if how == "flip" and data:
        for _ in range(rng.randrange(1, 9)):
            data[rng.randrange(len(data))] ^= rng.randrange(1, 256)
        path.write_bytes(data)
    elif how in ("cut", "empty"):
        path.write_bytes(data[: rng.randrange(len(data) + 1) if how == "cut" else 0])
    else:
        path.unlink()
        replaces: dict[str, Callable[[], object]] = {
            "folder": path.mkdir,
            "dangling": lambda: path.symlink_to(folder / "nowhere"),
            "loop": lambda: path.symlink_to(path),
            "fifo": lambda: os.mkfifo(path),
        }
        replaces.get(how, lambda: None)()
    return how


@pytest.mark.parametrize("seed", range(SEEDS))
def test_written_changes_survive_ten_kills_and_damage_and_undone_ones_do_not(tmp_path, seed):
    """Every run is killed; between two runs, one file is damaged and the clock is set."""
    rng = random.Random(seed)
    wall_s = [1.7e9]
    expected = None
    done: list[str] = []
    for _ in range(10):
        life = Life(tmp_path, wall_s, rng)
        if expected is not None:
            found = life.state()
            assert any(same(found, state) for state in expected), done
        for _ in range(rng.randrange(1, 14)):
            done.append(rng.choice(OPS))
            getattr(life, done[-1])()
            wall_s[0] += rng.choice((1.0, 1.0, -30 * 86_400.0, 86_400.0))
            if rng.random() < 0.05:
                life.disk.is_full = True
                life.write()
            elif life.disk.is_full and rng.random() < 0.5:
                life.free_disk()
        life.die()
        done.append(damage(tmp_path, rng))
        expected = life.durable if done[-1] == "none" else life.journalled
    assert "teach" in done


@crossed(learner=installed("default-6", "fair-knn-3"), seed=seeds(2, 4))
def test_every_learner_is_restored_after_a_kill(tmp_path, learner, seed):
    rng = random.Random(seed)
    expected = None
    for _ in range(5):
        life = Life(tmp_path, [0.0], rng, learner)
        if expected is not None:
            assert same(life.state(), expected)
        for _ in range(rng.randrange(4, 12)):
            op = rng.choice(("teach", "teach", "teach", "drive", "undo", "edit", "save", "write"))
            getattr(life, op)()
        life.write()
        life.policy.reset()  # each start of the program begins a new drive
        expected = life.state()
        life.die()


@crossed(saves=[False, True], seed=seeds(2, 4))
def test_the_moves_of_a_body_are_restored_after_a_kill(tmp_path, seed, saves):
    rng = random.Random(seed)
    steered = {f"steer_{i}": rng.choice((-0.8, -0.2, 0.0, 0.2, 0.8)) for i in range(4)}
    own = tuple(Move(Action(n), steering=s, throttle=0.5) for n, s in steered.items())
    life = Life(tmp_path, [0.0], rng, "default-6", declared=own)
    for op in ("teach", "write", *(("save",) if saves else ()), *("teach",) * 15, "write"):
        getattr(life, op)()
    life.policy.reset()
    life.die()
    after = Life(tmp_path, [0.0], rng, "default-6", declared=own)
    assert after.recovered and same(after.state(), life.state())
    assert after.policy.kinds.points == life.policy.kinds.points


@pytest.mark.parametrize("learner", ["published-4", "default-6"])
def test_after_the_last_image_was_deleted_the_next_start_has_none(tmp_path, learner):
    first = Life(tmp_path, [0.0], random.Random(1), learner)
    first.teach()
    for image in images(first.policy):
        first.loop.submit(lambda n=image.node_id: first.loop.history.edit("delete", n)).result(0)
    first.save()
    first.policy.reset()
    first.die()
    assert same(Life(tmp_path, [0.0], random.Random(1), learner).state(), first.state())


@pytest.mark.parametrize("seed", seeds(2, 5))
def test_runs_too_short_for_the_journal_lose_nothing_that_was_saved(tmp_path, seed):
    """Each run is killed after some saves, before its journal's thread has run."""
    rng = random.Random(seed)
    life = Life(tmp_path, [0.0], rng)
    for op in (life.teach, life.write, life.teach, life.save):
        op()
    for _ in range(6):
        newest = life.state()
        life.die()
        life = Life(tmp_path, [0.0], rng, writes=False)
        assert same(life.state(), newest)
        for _ in range(rng.randrange(4)):
            life.teach()
            life.save()


def test_the_journal_stays_small_and_needs_no_model(tmp_path):
    life = Life(tmp_path, [0.0], random.Random(3))
    for _ in range(30):
        for _ in range(5):
            life.teach()
        life.write()
        life.writer._writer.written_bytes += PART_BYTES // 3
    assert len(list_parts(tmp_path / "journal")) == 2
    life.write()
    life.die()
    shutil.rmtree(tmp_path / "models")
    assert same(Life(tmp_path, [0.0], random.Random(3)).state(), life.durable[-1])


def test_nothing_is_replayed_after_a_start_in_which_nothing_changed(tmp_path):
    life = Life(tmp_path, [0.0], random.Random(4))
    for op in (life.teach, life.save, life.write, life.die):
        op()
    for _ in range(3):
        idle = Life(tmp_path, [0.0], random.Random(4))
        assert not idle.recovered
        idle.die()
    assert len(list(tmp_path.glob("models/robot/*.npz"))) == 1


def check_a_disk_whose_flush_hangs_delays_no_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A kill loses only unwritten data, so writing does not wait for the flush against power
    cuts."""
    hangs, goes_on = threading.Event(), threading.Event()

    def flush(handle: int) -> None:
        hangs.set()
        assert goes_on.wait(60)

    life = Life(tmp_path, [0.0], random.Random(5), writes=False)
    monkeypatch.setattr(os, "fsync", flush)
    life.writer._clock = life.writer._thread._clock = RealClock()
    life.writer.start()
    disk = DiskThread(RealClock())
    disk.add(life.writer.sync)
    disk.start()
    try:
        life.teach()
        assert hangs.wait(60)
        for _ in range(3):
            life.teach()
            changes = life.loop.history.changes
            asyncio.run(asyncio.wait_for(life.writer.written(changes), 60))
            assert life.writer._written == changes
            # this applies only to the copy's own files
            monkeypatch.setattr(os, "fsync", lambda handle: None)
            left = Storage(tmp_path / f"left-{changes}")
            shutil.copytree(tmp_path / "journal", left.journal)
            found = recover(left.journal, ModelStore(left))
            assert found is not None and same(found.model.state, life.state())
    finally:
        goes_on.set()
        disk.stop()
        life.writer.stop()


@crossed(how=["remove", "empty", "cut", "rubbish"], seed=range(5))
def test_if_both_files_of_a_part_are_lost_the_saved_model_is_used(tmp_path, seed, how):
    """If only saved models are left, changes since the last save may be lost, but no older model
    may be loaded."""
    rng = random.Random(seed)
    life = Life(tmp_path, [0.0], rng)
    for op in ("teach", "teach", "write", "edit", "undo", "teach", "write"):
        getattr(life, op)()
    life.save()
    allowed = [life.state()]
    for _ in range(rng.randrange(1, 20)):
        life.teach(1)
        life.write()
        allowed.append(life.state())
    life.die()
    for path in list_parts(tmp_path / "journal")[-1].files(tmp_path / "journal"):
        data = path.read_bytes()
        if how == "remove":
            path.unlink()
        elif how == "cut":
            path.write_bytes(data[: rng.randrange(len(data))])
        else:
            path.write_bytes(rng.randbytes(len(data)) if how == "rubbish" else b"")
    found = Life(tmp_path, [0.0], rng).state()
    assert any(same(found, state) for state in allowed)


@pytest.mark.parametrize("seed", seeds(8, 30))
def test_a_flipped_byte_costs_one_record_of_one_file(tmp_path, seed):
    rng = random.Random(seed)
    records = [rng.randbytes(rng.randrange(200)) for _ in range(50)]
    paths = [tmp_path / "x.a", tmp_path / "x.b"]
    writer = RecordWriter(paths)
    writer.write(records)
    writer.close()
    assert [list(read_records(path)) for path in paths] == [records, records]
    data = bytearray(paths[0].read_bytes())
    data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    paths[0].write_bytes(data)
    left = list(read_records(paths[0]))
    assert len(left) >= len(records) - 1 and set(left) <= set(records)
    assert sum(map(len, map(frame_record, records))) == len(data)
