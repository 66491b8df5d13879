"""However the data folder is damaged, the server starts and drives, and reports moved files.

If the folder disappears, for example because its USB stick was pulled out, nothing is written below
the folder's path.
"""

import contextlib
import errno
import os
import random
import shutil
import socket
from pathlib import Path

import pytest

from robot.devices.rig import Rig
from robot.policy.registry import make_policy
from robot.store.folder import Storage, write_whole
from robot.store.prepare import prepare
from robot.store.presence import MARK, Presence
from robot.testing import FakeCamera, FakeDriver, VirtualClock
from robot.types import Action, Example
from server.access.pairing import Pairing
from server.gateway.roles import Role
from server.identity import IdentityFile
from server.library.models import ModelLibrary
from server.persistence import Persistence
from server.recordings.part import Recordings
from tests.kit.disk import Disk
from tests.kit.sizes import size
from tests.robot.recordings.drives import record_drive

from .virtual_server import VirtualServer

SEEDS = size("DAMAGE", 8, 100)
MOMENTS = size("MOMENTS", 4, 30)
KINDS = (
    "flip", "cut", "empty", "not utf-8", "huge", "folder", "dangling", "loop", "link to folder",
    "fifo", "socket", "remove", "unreadable",
)  # fmt: skip
ABSENT = ("dangling", "loop", "link to folder", "fifo", "socket") if os.name == "nt" else ()
"""Kinds of damage that do not exist on Windows, or that only few of its users can cause."""


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A data folder with all kinds of content, as a kill leaves it."""
    root = tmp_path_factory.mktemp("whole") / "data"
    with running(root) as (rig, persistence):
        teach(rig)
        persistence.autosave.save()
        persistence.autosave.begin("second")
        teach(rig)
    episode = record_drive(Storage(root).folder("episodes"), frames=20)
    episode.path.with_suffix(".edits.json").write_text(
        '{"format": 1, "title": "x", "protected": false, "edits": []}'
    )
    IdentityFile(root)
    Pairing(10, file=root / "paired.json")
    (root / "paired.json").write_text('{"sessions": []}')
    (root / "lessons").mkdir(exist_ok=True)
    (root / "lessons" / "20260101-120000-trial-1.json").write_text("{}")
    return root


class running:  # noqa: N801
    """A rig with persistence, started as `drivelesson serve` starts it."""

    def __init__(self, root: Path) -> None:
        self.moved = prepare(root)
        self.storage = Storage(root, must_be_usable=False)
        clock = VirtualClock(100.0)
        policy = make_policy("published-4")
        self.rig = Rig(FakeDriver(clock=clock), FakeCamera(clock), policy, clock)
        self.told: list[str] = []
        IdentityFile(root)
        Pairing(10, file=root / "paired.json")
        self.persistence = Persistence(
            self.storage, self.rig, name="bench", announce=lambda name, **_: self.told.append(name)
        )

    def __enter__(self) -> tuple[Rig, Persistence]:
        self.rig.start()
        self.persistence.start()
        self.persistence.autosave.load_last()
        return self.rig, self.persistence

    def __exit__(self, *error: object) -> None:
        self.persistence.stop()
        self.rig.stop()

    def listed(self) -> tuple[list[str], list[str]]:
        """Return the names of the models and the ids of the recordings that the page lists."""
        library = ModelLibrary(self.storage, self.persistence.models)
        recordings = self.persistence.part(Recordings).episodes
        recordings.offered()
        return [one.name for one in library.saved()], [one.id for one in recordings.summaries()]


def teach(rig: Rig) -> int:
    def request() -> int:
        history = rig.loop.history
        frame = rig.camera.latest()
        x = history.policy.extract(frame)
        for i in range(5):
            example = Example(frame_id=i, label=Action.LEFT, is_intervention=False)
            history.teach(example, x, i * 0.2)
        return history.taught.total()

    while rig.camera.latest() is None:
        rig.clock.sleep(0.01)
    return rig.clock.result(rig.loop.submit(request), 10)


LARGEST = 2**24
"""Larger files are already damaged by their size, and must not be read into memory."""


def damage(root: Path, rng: random.Random) -> str:
    """Damage one entry of the folder; return a description."""
    everything = [path for path in sorted(root.rglob("*")) if not path.is_symlink()]
    how = rng.choice([kind for kind in KINDS if kind not in ABSENT])
    if how == "not utf-8" and rng.random() < 0.5 and os.name != "nt":
        folder = rng.choice([path for path in (root, *everything) if path.is_dir()])
        name = os.fsencode(folder) + b"/" + rng.choice((b"\xff\xfe.mcap", b"caf\xe9", b"\xc3.npz"))
        Path(os.fsdecode(name)).write_bytes(b"x")
        return "a name that is no utf-8"
    if how in ("flip", "cut", "empty", "not utf-8", "huge", "unreadable"):
        whole = [path for path in everything if path.is_file()]
        path = rng.choice([path for path in whole if path.stat().st_size < LARGEST] or whole[:1])
        data = bytearray(path.read_bytes() or b"x")
        at = rng.randrange(len(data))
        if how == "flip":
            data[at] ^= 1 << rng.randrange(8)
        changed = {"cut": data[:at], "empty": b"", "not utf-8": b"\xff\xfe" + data}
        path.write_bytes(changed.get(how, data))
        if how == "huge":
            os.truncate(path, 3 * 2**30)
        if how == "unreadable":
            path.chmod(0)
        return f"{how} {path.name}"
    path = rng.choice(everything)
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink()
    if how == "folder":
        (path / "inner").mkdir(parents=True)
    elif how in ("dangling", "loop", "link to folder"):
        target = {"dangling": root / "nowhere", "loop": path}.get(how, root.parent)
        path.symlink_to(target)
    elif how == "fifo":
        os.mkfifo(path)
    elif how == "socket":
        with contextlib.chdir(path.parent):
            socket.socket(socket.AF_UNIX).bind(path.name)
    return f"{how} {path.name}"


@pytest.mark.filterwarnings("ignore::ResourceWarning")
@pytest.mark.parametrize("seed", range(SEEDS))
def test_after_every_start_the_robot_serves_drives_and_saves(whole, tmp_path, seed):
    rng = random.Random(seed)
    root = tmp_path / "data"
    shutil.copytree(whole, root)
    done = [damage(root, rng) for _ in range(rng.randrange(1, 4))]
    started = running(root)
    with started as (rig, persistence):
        assert started.storage.fault is None, done
        lessons = teach(rig)
        assert lessons >= 5
        started.listed()
        name = persistence.autosave.save()
        assert persistence.models.load(name).summary.n_examples == lessons, done
        assert persistence.part(Recordings).recorder.recording.fault is None, done
    for name, where in started.moved:
        assert os.path.lexists(root / where), (name, where, done)


@pytest.mark.parametrize("kind", ["file", "dangling", "loop", "fifo"])
def test_the_data_folder_itself_may_be_something_else(tmp_path, kind):
    root = tmp_path / "data"
    if kind == "file":
        root.write_text("my notes")
    elif kind == "fifo":
        os.mkfifo(root)
    else:
        root.symlink_to(root if kind == "loop" else tmp_path / "nowhere")
    started = running(root)
    with started as (rig, persistence):
        assert teach(rig) == 5
        assert persistence.autosave.save() == "bench"
    [(_, where)] = started.moved
    assert os.path.lexists(tmp_path / "data.1") or os.path.lexists(tmp_path / where)


def test_if_nothing_can_be_saved_the_robot_drives_and_reports_it():
    started = running(Path("/proc/drivelesson"))
    with started as (rig, persistence):
        assert started.storage.fault and str(Path("/proc/drivelesson")) in started.storage.fault
        assert teach(rig) == 5
        assert persistence.part(Recordings).recorder.recording.fault
        assert "recording_off" in started.told
        assert started.listed() == ([], [])
        with pytest.raises(OSError):
            persistence.autosave.save()


@pytest.mark.parametrize("name", ["episodes", "journal", "models", "trash"])
def test_a_data_folder_may_have_the_name_of_one_of_its_parts(whole, tmp_path, name):
    shutil.copytree(whole, tmp_path / name)
    started = running(tmp_path / name)
    assert started.moved == []
    with started as (_, persistence):
        assert persistence.autosave.name == "second"
        assert all(started.listed())


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EROFS, errno.EACCES, errno.EIO])
def test_a_disk_that_cannot_be_written_prevents_neither_start_nor_drive(
    whole, tmp_path, code, monkeypatch
):
    root = tmp_path / "data"
    shutil.copytree(whole, root)
    disk = Disk(root)
    with monkeypatch.context() as patch:
        disk.install(patch.setattr)
        disk.fail(0, lasts=True, why=code)
        started = running(root)
        with started as (rig, persistence):
            assert teach(rig) >= 5
            started.listed()
            with pytest.raises(OSError):
                persistence.autosave.save()
            persistence.autosave.save_if_changed()
            assert "model_not_saved" in started.told
    assert disk.calls > 0


def test_every_message_is_obeyed_even_if_the_disk_cannot_be_written(tmp_path):
    with (
        pytest.MonkeyPatch.context() as patch,
        VirtualServer(data=tmp_path) as server,
        server.pilot() as pilot,
    ):
        disk = Disk(tmp_path)
        disk.install(patch.setattr)
        disk.lay_beneath(server.persistence)
        disk.fail(0, lasts=True)
        for mode in ("train", "autonomous", "train"):
            pilot.mode(mode)
            pilot.wait_for_state(mode=mode)
        pilot.hold("forward")
        server.wait_until(lambda: server.driver.now is Action.FORWARD)
        pilot.send(type="stop")
        server.wait_until(lambda: server.driver.now is Action.STOP, 0.1)
        pilot.wait_for_state(emergency=True)
        pilot.release()
        pilot.wait_for_state(emergency=False)
        for word, is_pilot in (("yield", False), ("take", True)):
            pilot.send(type=word)
            pilot.wait_for_state(you_are_pilot=is_pilot)
        server.wait_until(lambda: server.persistence.writer.fault is not None, what="the fault")
        assert pilot.errors() == [] and disk.calls
        disk.heal()


def test_a_failing_model_is_reported_and_set_aside_at_the_next_start(tmp_path):
    with running(tmp_path) as (rig, persistence):
        before = teach(rig)
        persistence.autosave.save()
        teach(rig)

        def fail(*anything: object) -> None:
            raise RuntimeError("out of order")

        rig.loop.history.policy.learner.explain_one = fail
        while rig.loop.learning.failure is None:
            rig.clock.sleep(0.1)
        assert "out of order" in (rig.loop.state.fault or "")
        name = persistence.autosave.save()
    following = running(tmp_path)
    with following as (rig, persistence):
        assert "set_aside" in following.told
        assert persistence.autosave.name == name
        assert rig.loop.state.n_nodes > 0 and rig.loop.state.taught == {Action.LEFT: before}
        while rig.loop.state.prediction is None:
            rig.clock.sleep(0.1)
        assert rig.loop.state.prediction.action is Action.LEFT


FOREIGN = (
    ".stfolder/marker", "@eaDir/SYNO@.fileindexdb", "lost+found/#1234", ".Trash-1000/info/a",
    "$RECYCLE.BIN/desktop.ini", "System Volume Information/x", ".fseventsd/y", "Thumbs.db",
    ".DS_Store", "notes.txt", "desktop.ini", "~$plan.docx", ".~lock.plan.ods#", ".nfs0001",
    ".robot.syncthing.tmp", ".robot.mcap.part", "old/one.npz",
)  # fmt: skip
"""Files that sync tools, file managers and people leave in any folder."""


def test_files_of_other_programs_are_neither_moved_listed_nor_deleted(tmp_path, whole):
    root = tmp_path / "data"
    shutil.copytree(whole, root)
    folders = ("", "models", "models/second", "episodes", "exports", "trash", "journal")
    foreign = [root / folder / name for folder in folders for name in FOREIGN]
    for path in foreign:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("theirs")
        os.utime(path, (1.0, 1.0))
    if os.name != "nt":
        os.mkfifo(root / "episodes/backup.fifo")
        (root / "models/elsewhere").symlink_to(tmp_path)
    for _ in range(2):
        system = running(root)
        with system as (_, persistence):
            assert persistence.models.names() == ["bench", "second"]
            store = persistence.part(Recordings).episodes
            assert all(name.startswith("2023-") for name in store.ids())
            store.restore(store.delete(store.ids()[0]).key or "")
            persistence.storage.empty_trash()
        assert system.moved == []
    assert all(path.read_text() == "theirs" for path in foreign)


def pull(root: Path) -> Path:
    """Leave an empty folder at the path of the data folder, like an empty mount point."""
    away = root.with_name("away")
    root.rename(away)
    root.mkdir()
    return away


def plug_in(root: Path, away: Path) -> None:
    root.rmdir()  # this fails if anything was written there
    away.rename(root)


@pytest.mark.parametrize("seed", range(MOMENTS))
def test_a_folder_that_disappears_during_teaching_loses_nothing(tmp_path, seed):
    root, dice = tmp_path / "data", random.Random(seed)
    system = running(root)
    pairing, identity = Pairing(10, root / "paired.json"), IdentityFile(root)
    with system as (rig, persistence):
        for _ in range(dice.randrange(4)):
            teach(rig)
            rig.clock.sleep(dice.random() * 12.0)
        away = pull(root)
        learned = teach(rig)
        rig.clock.sleep(5.0)
        assert system.told.count("nothing_kept") == 1
        pairing.redeem(pairing.tokens[Role.PILOT], 0.0)
        with pytest.raises(OSError, match="data folder is gone"):
            identity.change(name="another")
        with pytest.raises(OSError, match="data folder is gone"):
            persistence.autosave.save()
        rig.clock.sleep(dice.random() * 30.0)
        assert list(root.iterdir()) == []
        is_back = dice.random() < 0.5
        if is_back:
            plug_in(root, away)
            rig.clock.sleep(5.0)
            assert system.told.count("kept_again") == 1
            learned = teach(rig)
    if not is_back:
        assert list(root.iterdir()) == [], "the end of the program writes nothing, either"
        plug_in(root, away)
    with running(root) as (_, persistence):
        saved = [model.summary.n_examples for _, model in persistence.models.good_models()]
        assert max(saved) == learned if is_back else max(saved, default=0) <= learned


def test_a_folder_is_known_again_on_another_disk_and_refused_only_while_it_is_gone(tmp_path):
    root, file = tmp_path / "data", tmp_path / "data/models/m/00001.npz"
    root.mkdir()
    presence = Presence(root)
    presence.watch()
    try:
        away = pull(root)
        write_whole(tmp_path / "other" / "file", b"x")
        with pytest.raises(OSError, match="data folder is gone"):
            write_whole(file, b"x")
        root.rmdir()
        root.mkdir()  # the same USB stick with another device number
        (root / MARK).write_bytes((away / MARK).read_bytes())
        assert presence.is_there() and presence.is_there()
        write_whole(file, b"x")
        root.rename(tmp_path / "gone")
        assert not presence.is_there()
    finally:
        presence.end_watch()
    write_whole(file, b"x")  # the server does not watch the folder now
