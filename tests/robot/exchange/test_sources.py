"""What can be imported at a path: recordings among other files, at any depth, packed or not."""

from __future__ import annotations

import random
import tarfile
import zipfile
from pathlib import Path

import numpy as np
import pytest

from robot.exchange.report import ImportReport
from robot.exchange.sources import find_drives, unpacked
from robot.exchange.steering import DEFAULT_THRESHOLD

from .test_imports import jpeg, tub_1

PLACES = ("", "a", "a/b", "a/b/c/d/e", "two words")


def recording(path: Path, pictures: int) -> None:
    files = [jpeg(number) for number in range(pictures)]
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez(
        path,
        jpeg=np.frombuffer(b"".join(files), np.uint8),
        offsets=np.cumsum([0, *map(len, files)], dtype=np.int64),
        labels=np.zeros(pictures, np.uint8),
        t=np.arange(pictures, dtype=np.float32) / 10,
    )


def pack(folder: Path, form: str) -> Path:
    """Return the folder itself, or an archive of what is in it."""
    path = folder.with_name(f"{folder.name}.{form}")
    if form == "zip":
        with zipfile.ZipFile(path, "w") as archive:
            for each in folder.rglob("*"):
                archive.write(each, each.relative_to(folder))
    elif form == "tar.gz":
        with tarfile.open(path, "w:gz") as tar:
            tar.add(folder, ".")
    return path if path.exists() else folder


@pytest.mark.parametrize("form", ["folder", "zip", "tar.gz"])
@pytest.mark.parametrize("seed", range(4))
def test_recordings_are_found_in_folders_and_archives(tmp_path: Path, seed: int, form: str) -> None:
    chance, folder, wanted = random.Random(seed), tmp_path / "drives", {}
    for number, place in enumerate(chance.choices(PLACES, k=chance.randrange(1, 5))):
        name = f"{chance.choice(('place', '7', 'ä b'))}-{number}.npz"
        wanted[name] = chance.randrange(1, 4)
        recording(folder / place / name, wanted[name])
    for hidden in ("._copy.npz", "_kept.npz", ".git/x.npz", "_old/x.npz"):
        recording(folder / hidden, 1)
    tub_1(folder / "tub", [0.0, 0.5])
    report = ImportReport()
    with unpacked(pack(folder, form), tmp_path, report) as path:
        sources = find_drives(path)
        read = {each.name: each.read(DEFAULT_THRESHOLD, report) for each in sources}
        assert {name: len(drive.shots) for name, drive in read.items()} == {**wanted, "tub": 2}
    assert list(report.lines()) == []


def test_what_lies_too_deep_or_is_a_folder_is_none(tmp_path: Path) -> None:
    recording(tmp_path / "x.npz", 1)
    recording(tmp_path / "1/2/3/4/5/6/deep.npz", 1)
    (tmp_path / "folder.npz").mkdir()
    assert [source.name for source in find_drives(tmp_path)] == ["x.npz"]
