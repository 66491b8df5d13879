"""The data folder works on the disks of all systems, and beside other programs."""

from __future__ import annotations

import errno
import os
import signal
import stat
import subprocess
import sys
import tracemalloc
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from pathlib import Path, PureWindowsPath
from threading import get_native_id

import platformdirs
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from robot.errors import ConfigurationError
from robot.store import folder as folder_module
from robot.store.disk import DiskThread
from robot.store.folder import (
    Storage,
    check_name,
    default_root,
    free_name,
    move,
    sync_folder,
    whole_file,
    write_whole,
)
from robot.store.lock import FolderLock
from robot.store.records import read_regular
from robot.testing import VirtualClock

# The folder -------------------------------------------------------------------------------------


def test_the_data_folder_is_the_chosen_or_the_systems(monkeypatch):
    monkeypatch.setenv("DRIVELESSON_DATA", "elsewhere")
    assert default_root() == Path("elsewhere")
    monkeypatch.delenv("DRIVELESSON_DATA")
    assert default_root() == Path(platformdirs.user_data_dir("drivelesson", appauthor=False))


@pytest.mark.skipif(not hasattr(os, "pathconf"), reason="only POSIX systems report this limit")
@pytest.mark.parametrize("spare", [60, 120, 170])
def test_a_folder_that_leads_to_too_long_paths_is_refused_at_once(tmp_path, spare):
    most = os.pathconf(tmp_path, "PC_PATH_MAX") - 1  # each path ends in a zero
    deep = tmp_path
    while (left := most - 300 - len(str(deep))) > 1:
        deep /= "d" * min(left - 1, 200)
    deep.mkdir(parents=True)
    root = deep / ("r" * (300 - 1 - spare))
    with pytest.raises(ConfigurationError, match=r"too long for this system.*--data FOLDER"):
        Storage(root)
    Storage(root, must_be_usable=False)
    assert list(Storage(deep).trash.iterdir()) == []


def test_programs_that_start_at_once_do_not_hinder_each_other(tmp_path):
    storage = Storage(tmp_path)
    with ThreadPoolExecutor(4) as programs:
        assert len(list(programs.map(lambda _: Storage(tmp_path), range(400)))) == 400
    assert list(storage.trash.iterdir()) == []


def test_two_threads_that_write_one_file_at_once_do_not_mix(tmp_path):
    path = tmp_path / "drive.mcap"
    # temporary files of ending and compacting recordings
    with ThreadPoolExecutor(1) as other, whole_file(path) as file:
        file.write(b"a" * 100_000)
        other.submit(write_whole, path, b"b" * 10).result()
        file.write(b"a" * 100_000)
        assert path.read_bytes() == b"b" * 10
    assert path.read_bytes() == b"a" * 200_000
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has such a folder")
@pytest.mark.skipif(sys.platform != "linux", reason="this file system exists only on Linux")
def test_a_folder_of_a_file_system_that_cannot_flush_folders_is_used_all_the_same():
    """Older Linux systems cannot flush the folders of Windows and of virtual machines."""
    handle = os.open("/proc", os.O_RDONLY)
    with pytest.raises(OSError, match="Invalid argument"):
        os.fsync(handle)
    os.close(handle)
    sync_folder(Path("/proc"))
    with pytest.raises(FileNotFoundError):
        sync_folder(Path("/proc/none"))


def test_an_unwritable_trash_does_not_prevent_saving(tmp_path):
    (tmp_path / "trash").symlink_to("/proc/self")
    assert Storage(tmp_path, must_be_usable=False).fault is None
    with pytest.raises(ConfigurationError, match="cannot be used"):
        Storage(tmp_path)


def test_a_folder_in_which_only_the_parts_are_writable_is_a_fault(tmp_path):
    storage = Storage(tmp_path, must_be_usable=False)
    assert storage.fault is None and not (tmp_path / ".probe").exists()
    (tmp_path / f"..probe.{get_native_id()}.part").mkdir()  # nothing can be written there
    fault = Storage(tmp_path, must_be_usable=False).fault
    assert fault is not None and str(tmp_path) in fault


@pytest.mark.skipif(os.name == "nt", reason="Windows has no permission bits")
@pytest.mark.parametrize("before", [None, 0o755, 0o777, 0o750])
def test_nobody_else_can_enter_the_data_folder(tmp_path, before):
    root = tmp_path / "data"
    if before is not None:
        root.mkdir()
        root.chmod(before)
    Storage(root)
    assert stat.S_IMODE(root.stat().st_mode) == 0o700


def test_only_a_regular_file_of_the_allowed_size_is_read_into_no_larger_buffer(tmp_path):
    """On Windows, a buffer for the largest file took a second for each model in a list."""
    path, data = tmp_path / "model", bytes(range(256))
    path.write_bytes(data)
    tracemalloc.start()
    try:
        assert read_regular(path, 1 << 28) == data
        assert tracemalloc.get_traced_memory()[1] < 1 << 20
    finally:
        tracemalloc.stop()
    assert read_regular(path, 256) == data
    with pytest.raises(OSError, match="more than"):
        read_regular(path, 255)
    with pytest.raises(OSError):
        read_regular(tmp_path, 1 << 20)


# The lock of the program that uses the folder ---------------------------------------------------


def test_the_lock_names_its_process_and_is_released_when_it_ends_or_is_killed(tmp_path):
    pytest.importorskip("fcntl")
    lock = FolderLock(tmp_path)
    lock.stop()
    with lock:
        lock.start()
        with pytest.raises(ConfigurationError, match=rf"process {os.getpid()}.*--data"):
            FolderLock(tmp_path).start()
    hold = (
        "import sys, pathlib; from robot.store.lock import FolderLock;"
        "lock = FolderLock(pathlib.Path(sys.argv[1])); lock.start(); print('held', flush=True);"
        "sys.stdin.read()"
    )
    command, pipe = [sys.executable, "-c", hold, str(tmp_path)], subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as holder:
        assert holder.stdout is not None and holder.stdout.readline() == "held\n"
        with pytest.raises(ConfigurationError, match=f"process {holder.pid}"):
            lock.start()
        holder.send_signal(signal.SIGKILL)
    lock.start()
    with pytest.raises(ConfigurationError, match="gone"):
        FolderLock(tmp_path / "gone").start()


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.EOPNOTSUPP])
def test_a_folder_of_a_file_system_without_locks_can_be_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    fcntl = pytest.importorskip("fcntl")

    def refuse(*args: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "flock", refuse)
    FolderLock(tmp_path).start()


# Names and files on other systems' disks --------------------------------------------------------

DEVICES = ["con", "prn", "aux", "nul", "conin$", "conout$"]
DEVICES += [f"{port}{number}" for port in ("com", "lpt") for number in "0123456789¹²³"]
awkward = st.builds(
    "".join,
    st.lists(st.sampled_from([*DEVICES, *DEVICES, "x", ".", " ", ":", "\\", "/", "?", "é", "ı"])),
)
cased = st.builds(lambda name, upper: name.upper() if upper else name, awkward, st.booleans())


@given(cased | st.text(max_size=70))
@example("aux .txt")
@example("COM¹")
@example("a. .")
def test_an_accepted_name_is_valid_on_every_disk(name):
    try:
        tidy = check_name(name)
    except ConfigurationError:
        return
    for file in (tidy, f"{tidy}.mcap", f"{tidy}.edits.json"):
        stem = file.split(".")[0].rstrip(" ").lower()
        assert stem not in DEVICES, "Windows would open a device of this name"
        assert file == file.rstrip(". ") and not set(file) & set('<>:"/\\|?*\0')
        assert PureWindowsPath("C:/data", file).name == file
    assert check_name(tidy) == tidy


@given(st.lists(st.sampled_from(["Kitchen", "kitchen", "KITCHEN", "Straße", "STRASSE", "x" * 64])))
def test_names_that_a_case_blind_disk_mixes_up_are_told_apart(wanted):
    taken: set[str] = set()
    for name in wanted:
        taken.add(free_name(name, taken))
    assert len({name.casefold() for name in taken}) == len(wanted)
    assert all(check_name(name) == name for name in taken)


class SharingError(PermissionError):
    """The error of Windows while another program has a file open."""

    def __init__(self, winerror: int) -> None:
        super().__init__(13, "in use")
        self.winerror = winerror


@pytest.mark.parametrize(
    ("error", "times"),
    [
        *((SharingError(5), 1), (SharingError(32), 5), (SharingError(32), 99)),
        *((PermissionError(13, "no"), 99), (OSError(28, "full"), 99)),
    ],
)
def test_a_file_that_another_program_reads_is_replaced_later_or_stays_as_it_was(
    tmp_path, monkeypatch, error, times
):
    path = tmp_path / "paired.json"
    write_whole(path, b"old")
    left, replace, pauses, is_refused = [times], Path.replace, list[float](), times == 99

    def refusing(source, target):
        left[0] -= 1
        if left[0] >= 0:
            raise error
        return replace(source, target)

    monkeypatch.setattr(Path, "replace", refusing)
    monkeypatch.setattr(folder_module.time, "sleep", pauses.append)
    with pytest.raises(type(error)) if is_refused else nullcontext():
        write_whole(path, b"new")
    assert path.read_bytes() == (b"old" if is_refused else b"new")
    assert list(tmp_path.iterdir()) == [path]
    assert bool(pauses) is isinstance(error, SharingError), "only sharing errors are retried"
    assert is_refused or (len(pauses) == times and sum(pauses) < 2)


def test_a_folder_is_moved_with_its_files(tmp_path):
    write_whole(tmp_path / "a" / "1.npz", b"x")
    move(tmp_path / "a", tmp_path / "b")
    assert (tmp_path / "b" / "1.npz").read_bytes() == b"x"


@pytest.mark.parametrize("hangs_s", [0.0, 60.0])
def test_the_disks_thread_works_every_fifth_of_a_second_when_woken_and_at_its_end(hangs_s):
    clock, ran_s = VirtualClock(), list[float]()
    disk = DiskThread(clock)
    disk.add(lambda: ran_s.append(clock.now_s()))
    with disk:
        disk.start()
        clock.sleep(0.5)
        disk.wake()
        clock.sleep(0.05)
        disk.add(lambda: clock.sleep(hangs_s))
    assert ran_s == pytest.approx([0.2, 0.4, 0.5, 0.55])
    assert clock.now_s() == pytest.approx(0.55 + min(hangs_s, 10.0))
