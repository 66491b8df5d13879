"""The drives that are found at a path: among other files, at any depth, packed or not."""

from __future__ import annotations

import json
import random
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

from .tubs import jpeg, tub_1, tub_2

PLACES = ("", "a", "a/b", "a/b/c/d/e", "two words")


def pack(folder: Path, form: str) -> Path:
    """Return the folder itself, or an archive of its content."""
    path = folder.with_name(f"{folder.name}.{form}")
    if form == "zip":
        with zipfile.ZipFile(path, "w") as archive:
            for each in folder.rglob("*"):
                archive.write(each, each.relative_to(folder))
    elif form == "tar.gz":
        with tarfile.open(path, "w:gz") as tar:
            tar.add(folder, ".")
    return path if path.exists() else folder


@crossed(form=["folder", "zip", "tar.gz"], seed=range(4))
def test_recordings_are_found_in_folders_and_archives(tmp_path: Path, seed: int, form: str) -> None:
    chance, folder, wanted = random.Random(seed), tmp_path / "drives", {}
    for number, place in enumerate(chance.choices(PLACES, k=chance.randrange(1, 5))):
        name = f"{chance.choice(('place', '7', 'ä b'))}-{number}.npz"
        wanted[name] = chance.randrange(1, 4)
        write_footage(folder / place / name, wanted[name])
    for hidden in ("._copy.npz", "_kept.npz", ".git/x.npz", "_old/x.npz"):
        write_footage(folder / hidden, 1)
    tub_1(folder / "tub", [{"user/angle": 0.5, "user/throttle": 0.3} for _ in range(2)])
    report = ImportReport()
    with unpacked(pack(folder, form), tmp_path, report) as path:
        sources = find_drives(path)
        read = {each.name: each.read(Reading(), report) for each in sources}
        assert {name: len(drive.shots) for name, drive in read.items()} == {**wanted, "tub": 2}
    assert list(report.lines()) == []


def test_files_that_are_too_deep_and_folders_are_not_recordings(tmp_path: Path) -> None:
    write_footage(tmp_path / "x.npz", 1)
    write_footage(tmp_path / "1/2/3/4/5/6/deep.npz", 1)
    (tmp_path / "folder.npz").mkdir()
    assert [source.name for source in find_drives(tmp_path)] == ["x.npz"]


@pytest.mark.parametrize("kind", ["table", "recordings", "tub"])
def test_extra_files_of_macos_and_names_in_capitals_hide_no_recording(
    tmp_path: Path, kind: str
) -> None:
    folder = tmp_path / "drive"
    if kind == "tub":
        tub_2(folder, [{"user/angle": 0.0, "user/throttle": 0.3}])
        (folder / "manifest.json").unlink()
        (folder / "._catalog_0.catalog").write_bytes(b"\0\5\26\7{}")
    elif kind == "table":
        folder.mkdir()
        (folder / "A.JPG").write_bytes(jpeg(1))
        (folder / "FRAMES.CSV").write_bytes(b"\xef\xbb\xbffile,label\r\nA.JPG,left\r\n")
        (folder / "._FRAMES.CSV").write_bytes(b"\0\5\26\7")
    else:
        write_footage(folder / "x.npz", 1)
        (folder / "x.npz").rename(folder / "X.NPZ")
        (folder / "._X.NPZ").write_bytes(b"\0\5\26\7")
    report = ImportReport()
    [source] = find_drives(folder)
    assert len(source.read(Reading(), report).shots) == 1
    assert {place for place, _ in report.skipped} <= {"manifest.json"}
    alone = {"table": "FRAMES.CSV", "recordings": "X.NPZ"}.get(kind, "")
    assert len(find_drives(folder / alone)) == 1


@crossed(bad=["n" * 300, "a.csv/x", ".", "b"], form=["tar", "zip"])
def test_an_impossible_file_name_affects_only_its_own_entry(
    tmp_path: Path, form: str, bad: str
) -> None:
    names, path = ["a.csv", "b/x.txt", bad, "c/y.txt"], tmp_path / f"drive.{form}"
    if form == "tar":
        with tarfile.open(path, "w") as tar:
            for name in names:
                tar.addfile(tarfile.TarInfo(name))
    else:
        with zipfile.ZipFile(path, "w") as archive:
            for name in names:
                archive.writestr(name, b"")
    report = ImportReport()
    with unpacked(path, tmp_path, report) as folder:
        found = {each.relative_to(folder).as_posix() for each in folder.rglob("*")}
    assert found == {"a.csv", "b", "b/x.txt", "c", "c/y.txt"}
    [(place, why)] = report.skipped
    assert place == bad[:80] and why.startswith("cannot be unpacked")


def test_an_entry_that_leads_out_of_an_archive_is_reported_safely(tmp_path: Path) -> None:
    path, report = tmp_path / "drive.zip", ImportReport()
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("../frames.csv", b"")
        archive.writestr("../\x1b[2J\x07\nskipped: none", b"")
    with pytest.raises(RecordingError) as refused, unpacked(path, tmp_path, report) as folder:
        find_drives(folder)
    assert str(refused.value).startswith(f"{path} cannot be imported: it is empty")
    assert "the first in ../frames.csv: the path leads out of the archive" in str(refused.value)
    assert all(line.isprintable() for line in report.lines())


@pytest.mark.parametrize("name", ["a\0b.catalog", "\ud800.catalog", "x" * 300])
def test_a_catalog_of_a_name_that_no_file_can_have_is_skipped(tmp_path: Path, name: str) -> None:
    folder = tub_2(tmp_path / "tub", [{"user/angle": 0.0, "user/throttle": 0.3}])
    *lines, last = (folder / "manifest.json").read_text().splitlines()
    catalogs = json.loads(last)
    catalogs["paths"].insert(0, name)
    (folder / "manifest.json").write_text("\n".join([*lines, json.dumps(catalogs)]))
    report = ImportReport()
    assert len(find_drives(folder)[0].read(Reading(), report).shots) == 1
    assert [why.partition(":")[0] for _, why in report.skipped] == ["cannot be read"]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("labels", np.zeros((1, 3), np.uint8)),
        ("t", np.array(["a", "b", "c"])),
        ("t", np.zeros(3, complex)),
        ("t", np.zeros(3, "M8[s]")),
        ("offsets", np.zeros((2, 2), int)),
    ],
)
def test_an_array_of_another_form_is_refused_with_a_sentence(
    tmp_path: Path, name: str, value: Any
) -> None:
    write_footage(tmp_path / "x.npz", 3)
    with np.load(tmp_path / "x.npz") as arrays:
        np.savez(tmp_path / "y.npz", **{**arrays, name: value})
    with pytest.raises(RecordingError, match="not of the expected form"):
        load_recording(tmp_path / "y.npz")


def test_an_npz_file_of_another_program_is_refused_and_the_way_to_write_one_is_said(
    tmp_path: Path,
) -> None:
    np.savez(tmp_path / "x.npz", observations=np.zeros((5, 9, 9, 3), np.uint8), actions=np.zeros(5))
    with pytest.raises(RecordingError, match="not written by: drivelesson episodes export NAME"):
        load_recording(tmp_path / "x.npz")
