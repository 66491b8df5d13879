"""Only one program at a time records into a folder."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from robot.errors import ConfigurationError
from robot.store.lock import FolderLock

pytest.importorskip("fcntl")


def test_a_second_program_is_told_which_one_uses_the_folder(tmp_path: Path) -> None:
    with FolderLock(tmp_path), pytest.raises(ConfigurationError, match="--data") as refusal:
        FolderLock(tmp_path).start()
    assert f"process {os.getpid()}" in str(refusal.value)


def test_the_lock_is_released_afterwards_and_taken_only_once(tmp_path: Path) -> None:
    lock = FolderLock(tmp_path)
    lock.stop()
    with lock:
        lock.start()
    with FolderLock(tmp_path):
        lock.stop()
        with pytest.raises(ConfigurationError):
            lock.start()


def test_a_missing_folder_is_an_error_that_names_it(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="gone"):
        FolderLock(tmp_path / "gone").start()


def test_a_killed_process_releases_the_lock(tmp_path: Path) -> None:
    hold = (
        "import sys, pathlib; from robot.store.lock import FolderLock;"
        "lock = FolderLock(pathlib.Path(sys.argv[1])); lock.start(); print('held', flush=True);"
        "sys.stdin.read()"
    )
    command = [sys.executable, "-c", hold, str(tmp_path)]
    pipe = subprocess.PIPE
    holder = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True)
    with holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(ConfigurationError, match=f"process {holder.pid}"):
            FolderLock(tmp_path).start()
        holder.send_signal(signal.SIGKILL)
    FolderLock(tmp_path).start()
