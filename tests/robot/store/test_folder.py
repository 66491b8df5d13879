"""One data folder, with any other installed programs."""

from __future__ import annotations

import os
import stat
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import get_native_id

import platformdirs
import pytest

from robot.errors import ConfigurationError
from robot.store.folder import Storage, default_root, whole_file, write_whole

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize("missing", ["mcap", "zstandard", "cv2", "sklearn"])
def test_the_data_folder_is_the_chosen_or_the_systems_with_and_without_extras(
    missing: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, missing, None)
    monkeypatch.setenv("DRIVELESSON_DATA", "elsewhere")
    assert default_root() == Path("elsewhere")
    monkeypatch.delenv("DRIVELESSON_DATA")
    assert default_root() == Path(platformdirs.user_data_dir("drivelesson", appauthor=False))


def test_the_library_that_locates_the_folder_is_a_base_dependency() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert any(one.startswith("platformdirs") for one in project["dependencies"])
    extras = [one for extra in project["optional-dependencies"].values() for one in extra]
    assert not any(one.startswith("platformdirs") for one in extras)


@pytest.mark.skipif(not hasattr(os, "pathconf"), reason="the limit is asked of a POSIX system")
@pytest.mark.parametrize("spare", [60, 120, 170])
def test_a_folder_that_leads_to_too_long_paths_is_refused_at_once(
    tmp_path: Path, spare: int
) -> None:
    most = os.pathconf(tmp_path, "PC_PATH_MAX") - 1  # a zero ends each
    deep = tmp_path
    while (left := most - 300 - len(str(deep))) > 1:
        deep /= "d" * min(left - 1, 200)
    deep.mkdir(parents=True)
    root = deep / ("r" * (300 - 1 - spare))
    with pytest.raises(ConfigurationError, match=r"too long for this system.*--data FOLDER"):
        Storage(root)
    Storage(root, must_be_usable=False)
    storage = Storage(deep)
    assert list(storage.trash.iterdir()) == []


def test_programs_that_start_at_once_do_not_hinder_each_other(tmp_path: Path) -> None:
    storage = Storage(tmp_path)
    with ThreadPoolExecutor(4) as programs:
        assert len(list(programs.map(lambda _: Storage(tmp_path), range(400)))) == 400
    assert list(storage.trash.iterdir()) == []


def test_two_threads_that_write_one_file_at_once_do_not_mix(tmp_path: Path) -> None:
    path = tmp_path / "drive.mcap"
    with ThreadPoolExecutor(1) as other, whole_file(path) as file:  # an ending, and a compacting
        file.write(b"a" * 100_000)
        other.submit(write_whole, path, b"b" * 10).result()
        file.write(b"a" * 100_000)
        assert path.read_bytes() == b"b" * 10
    assert path.read_bytes() == b"a" * 200_000
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.skipif(sys.platform != "linux", reason="Linux has a folder that takes nothing")
def test_an_unwritable_trash_does_not_prevent_saving(tmp_path: Path) -> None:
    (tmp_path / "trash").symlink_to("/proc/self")
    assert Storage(tmp_path, must_be_usable=False).fault is None
    with pytest.raises(ConfigurationError, match="cannot be used"):
        Storage(tmp_path)


def test_a_folder_in_which_only_the_parts_are_writable_is_a_fault(tmp_path: Path) -> None:
    storage = Storage(tmp_path, must_be_usable=False)
    assert storage.fault is None and not (tmp_path / ".probe").exists()
    (tmp_path / f"..probe.{get_native_id()}.part").mkdir()  # nothing can be written there
    fault = Storage(tmp_path, must_be_usable=False).fault
    assert fault is not None and str(tmp_path) in fault


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such rights")
@pytest.mark.parametrize("before", [None, 0o755, 0o777, 0o750])
def test_nobody_else_can_enter_the_data_folder(tmp_path: Path, before: int | None) -> None:
    root = tmp_path / "data"
    if before is not None:
        root.mkdir()
        root.chmod(before)
    Storage(root)
    assert stat.S_IMODE(root.stat().st_mode) == 0o700
