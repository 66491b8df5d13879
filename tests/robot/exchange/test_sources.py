"""All recorded drives below a path are found, at any depth, in archives, and beside other files."""

from __future__ import annotations

import io
import tarfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robot.errors import RecordingError
from robot.exchange.drive import ImportReport
from robot.exchange.npz import load_recording
from robot.exchange.reading import Reading
from robot.exchange.sources import find_drives, unpacked
from tests.kit.sizes import crossed
from tests.robot.footage import write_footage

from .imported import put, tub_1, tub_2

RECORD = {"user/angle": 0.5, "user/throttle": 0.3}


def pack(path: Path, content: dict[str, bytes]) -> Path:
    """Write an archive of these files (content by name). The archive's name determines its kind."""
    if path.suffix == ".zip":
        with zipfile.ZipFile(path, "w") as archive:
            for name, data in content.items():
                archive.writestr(name, data)
    else:
        kind = path.suffix.lstrip(".")
        with tarfile.open(path, f"w:{'' if kind == 'tar' else kind}") as tar:
            for name, data in content.items():
                info = tarfile.TarInfo(name)
                info.size = len(data)
                tar.addfile(info, io.BytesIO(data))
    return path


@pytest.mark.parametrize("form", ["", "zip", "tar", "tar.gz", "tar.xz"])
def test_recordings_are_found_in_folders_and_archives(tmp_path: Path, form: str) -> None:
    folder = tmp_path / "drives"
    wanted = {"one.npz": 1, "7.npz": 2, "ä b.npz": 3}
    for place, (name, count) in zip(("", "a/b/c/d/e", "two words"), wanted.items(), strict=True):
        write_footage(folder / place / name, count)
    for hidden in ("._copy.npz", "_kept.npz", ".git/x.npz", "_old/x.npz", "1/2/3/4/5/6/deep.npz"):
        write_footage(folder / hidden, 1)
    (folder / "folder.npz").mkdir()
    tub_1(folder / "tub", [dict(RECORD), dict(RECORD)])
    path, report = folder, ImportReport()
    if form:
        files = [each for each in folder.rglob("*") if each.is_file()]
        content = {each.relative_to(folder).as_posix(): each.read_bytes() for each in files}
        path = pack(tmp_path / f"drives.{form}", content)
    with unpacked(path, tmp_path, report) as found:
        drives = {each.name: each.read(Reading(), report) for each in find_drives(found)}
        assert {name: len(drive.shots) for name, drive in drives.items()} == {**wanted, "tub": 2}
    assert report.lines() == []


@pytest.mark.parametrize("kind", ["FRAMES.CSV", "X.NPZ", "catalog_0.catalog"])
def test_extra_files_of_macos_and_names_in_capitals_hide_no_recording(
    tmp_path: Path, kind: str
) -> None:
    folder = put(tmp_path / "drive", "A.JPG") if kind == "FRAMES.CSV" else tmp_path / "drive"
    if kind == "FRAMES.CSV":
        (folder / kind).write_bytes(b"\xef\xbb\xbffile,label\r\nA.JPG,left\r\n")
    elif kind == "X.NPZ":
        write_footage(folder / "x.npz", 1).rename(folder / kind)
    else:
        tub_2(folder, [dict(RECORD)])
        (folder / "manifest.json").unlink()
    (folder / f"._{kind}").write_bytes(b"\0\5\26\7{}")
    report = ImportReport()
    [source] = find_drives(folder)
    assert len(source.read(Reading(), report).shots) == 1
    assert {place for place, _ in report.skipped} <= {"manifest.json"}
    assert kind == "catalog_0.catalog" or len(find_drives(folder / kind)) == 1


@crossed(bad=["n" * 300, "a.csv/x", ".", "b"], form=["tar", "zip"])
def test_an_impossible_file_name_affects_only_its_own_entry(
    tmp_path: Path, form: str, bad: str
) -> None:
    names, report = ["a.csv", "b/x.txt", bad, "c/y.txt"], ImportReport()
    path = pack(tmp_path / f"drive.{form}", dict.fromkeys(names, b""))
    with unpacked(path, tmp_path, report) as folder:
        found = {each.relative_to(folder).as_posix() for each in folder.rglob("*")}
    assert found == {"a.csv", "b", "b/x.txt", "c", "c/y.txt"}
    [(place, why)] = report.skipped
    assert place == bad[:80] and why.startswith("cannot be unpacked")


def test_an_entry_that_leads_out_of_an_archive_is_reported_safely(tmp_path: Path) -> None:
    report = ImportReport()
    names = ["../frames.csv", "../\x1b[2J\x07\nskipped: none"]
    path = pack(tmp_path / "drive.zip", dict.fromkeys(names, b""))
    with pytest.raises(RecordingError) as refused, unpacked(path, tmp_path, report) as folder:
        find_drives(folder)
    assert str(refused.value).startswith(f"{path} cannot be imported: it is empty")
    assert "the first at ../frames.csv: the path leads out of the archive" in str(refused.value)
    assert all(line.isprintable() for line in report.lines())


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"labels": np.zeros((1, 3), np.uint8)}, "has an array of a wrong shape or type"),
        ({"t": np.array(["a", "b", "c"])}, "has an array of a wrong shape or type"),
        ({"t": np.zeros(3, complex)}, "has an array of a wrong shape or type"),
        ({"t": np.zeros(3, "M8[s]")}, "has an array of a wrong shape or type"),
        ({"offsets": np.zeros((2, 2), int)}, "has an array of a wrong shape or type"),
        ({"labels": np.array([print] * 3, dtype=object)}, "x.npz"),  # a pickle
        ({"labels": np.full(3, 9, np.uint8)}, "labels other than 0, 1 and 2"),
        ({"t": np.zeros(2)}, "has an array of a wrong shape or type"),
        ({"angle": np.float32([0, 1.5, 0])}, "outside -1 to 1"),
        ({"angle": np.float32([0, np.inf, 0])}, "outside -1 to 1"),
        ({"angle": np.float32([0, 0])}, "angle or throttle of a wrong type"),
        ({"jpeg": None}, "not written by: drivelesson episodes export NAME"),
    ],
)
def test_an_npz_file_that_is_not_a_recording_is_refused(
    tmp_path: Path, changes: dict[str, Any], complaint: str
) -> None:
    steering = {"angle": np.zeros(3, np.float32), "throttle": np.zeros(3, np.float32)}
    write_footage(tmp_path / "x.npz", 3, **{**steering, **changes})
    with pytest.raises(RecordingError, match=complaint):
        load_recording(tmp_path / "x.npz")


def test_an_npz_file_that_claims_to_unpack_to_too_much_is_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "x.npz", "w") as archive:
        archive.writestr("jpeg.npy", b"")
        archive.infolist()[0].file_size = 600 * 2**20
    with pytest.raises(RecordingError, match="512 MB"):
        load_recording(tmp_path / "x.npz")
