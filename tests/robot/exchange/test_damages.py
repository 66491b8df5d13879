"""Damaged tubs and tables: every intact part is imported, and nothing wrong is taught."""

from __future__ import annotations

import random
import shutil
import tarfile
from pathlib import Path

import pytest

from robot.errors import RecordingError
from robot.exchange.drive import ImportReport, write_episode
from robot.exchange.sources import unpacked
from robot.recordings.episode import open_episode
from robot.types import Action
from tests.kit.sizes import size

from .imported import drive_at, taught_labels
from .tubs import Record, jpeg, tub_1, tub_2

TUBS = size("TUBS", 12, 500)
LABELS = {-0.7: Action.LEFT, 0.0: Action.FORWARD, 0.6: Action.RIGHT}
PICTURE = "{}_cam_image_array_.jpg"
Truth = dict[int, Action | None]
"""The label of each intact record."""


# On records, before they are written


def bad_number(dice: random.Random, records: list[Record], truth: Truth) -> None:
    number = dice.randrange(len(records))
    bad = [None, float("nan"), float("inf"), -float("inf"), "left", True, [], {}, 37.0, 10**400, ""]
    records[number][dice.choice(["user/angle", "user/throttle"])] = dice.choice(bad)
    truth.pop(number, None)


def no_angle(dice: random.Random, records: list[Record], truth: Truth) -> None:
    number = dice.randrange(len(records))
    records[number].pop("user/angle", None)
    truth.pop(number, None)


def autopilot(dice: random.Random, records: list[Record], truth: Truth) -> None:
    mode = dice.choice(["local", "local_angle", "pilot", "auto", None, 7])
    for number in range(dice.randrange(len(records)), len(records)):
        records[number] |= {"user/mode": mode, "user/angle": 0, "user/throttle": 0.4}
        if number in truth:
            truth[number] = None


def moved(dice: random.Random, records: list[Record], truth: Truth) -> None:
    home = dice.choice(["/home/pi/mycar/data/images/", "C:\\cars\\data\\images\\"])
    for number, record in enumerate(records):
        record["cam/image_array"] = home + PICTURE.format(number)


def strange_times(dice: random.Random, records: list[Record], truth: Truth) -> None:
    for record in records[dice.randrange(len(records)) :]:
        strange = [0, None, "x", -5, float("nan"), 10**30, 1_600_000_000_000, 1e12, True]
        record["_timestamp_ms"] = dice.choice(strange)


# On the files of a tub, which may be damaged already; `count` is the number of its records


def bad_picture(dice: random.Random, tub: Path, truth: Truth, count: int) -> None:
    path = dice.choice(sorted(tub.rglob("*.jpg")))
    whole, number = path.read_bytes(), int(path.name.partition("_")[0])
    cut = whole[: len(whole) // 2]
    path.write_bytes(dice.choice([b"", whole[:-1], cut, whole[:99] + bytes(len(whole)), b"GIF89a"]))
    if dice.random() < 0.2:
        path.unlink()
    truth.pop(number, None)


def a_catalog(dice: random.Random, tub: Path, count: int) -> tuple[Path, list[int]]:
    """Return a catalog, and the numbers of its records."""
    first = 10 * dice.randrange((count + 9) // 10)
    return tub / f"catalog_{first // 10}.catalog", list(range(first, min(first + 10, count)))


def lost_catalog(dice: random.Random, tub: Path, truth: Truth, count: int) -> None:
    path, numbers = a_catalog(dice, tub, count)
    path.unlink(missing_ok=True)
    for number in numbers:
        truth.pop(number, None)


def cut_line(dice: random.Random, tub: Path, truth: Truth, count: int) -> None:
    path, numbers = a_catalog(dice, tub, count)
    lines = path.read_bytes().splitlines(keepends=True) if path.exists() else []
    if len(lines) == len(numbers):  # no line break is lost yet
        place = dice.randrange(len(lines))
        ending = dice.choice([b"", b"\n", bytes(50), b"\xff\xfe\n"])
        lines[place] = lines[place][: dice.randint(1, len(lines[place]) - 3)] + ending
        path.write_bytes(b"".join(lines))
        truth.pop(numbers[place], None)


def lost_line_breaks(dice: random.Random, tub: Path, truth: Truth, count: int) -> None:
    path, _ = a_catalog(dice, tub, count)
    if path.exists():
        path.write_bytes(path.read_bytes().replace(b"\n", b""))


def spoilt_manifest(dice: random.Random, tub: Path, truth: Truth, count: int) -> None:
    path = tub / "manifest.json"
    text = path.read_bytes() if path.exists() else b"\n" * 5
    deleted = text.replace(b'"deleted_indexes": []', b'"deleted_indexes": null')
    moved = text.replace(b'"catalog_', b'"/home/pi/mycar/data/catalog_')
    cut = text[: dice.randrange(len(text) + 1)]
    path.write_bytes(dice.choice([b"", b"\0" * 90, cut, deleted, moved, b"[]\n" * 5]))
    if dice.random() < 0.15:
        path.unlink()


ON_RECORDS = [bad_number, no_angle, autopilot, moved, strange_times]
ON_FILES = [bad_picture, lost_catalog, cut_line, lost_line_breaks, spoilt_manifest]


def damaged_tub(dice: random.Random, folder: Path) -> Truth:
    """Write a tub with some faults, and return its true content."""
    angles = dice.choices(list(LABELS), k=dice.randint(6, 30))
    drive = {"user/throttle": 0.4, "user/mode": "user"}
    records, truth = [{"user/angle": angle, **drive} for angle in angles], Truth()
    truth |= {number: LABELS[angle] for number, angle in enumerate(angles)}
    is_first = dice.random() < 0.25
    for spoil in dice.choices(ON_RECORDS, k=dice.randint(0, 3)):
        spoil(dice, records, truth)
    (tub_1 if is_first else tub_2)(folder, records)
    kinds = ON_FILES[:1] if is_first else ON_FILES
    for spoil_files in dice.choices(kinds, k=dice.randint(0, 2)):
        spoil_files(dice, folder, truth, len(records))
    return truth


def packed(folder: Path, dice: random.Random) -> Path:
    """Return the tub itself, an archive of it of one of three kinds, or a folder of tubs."""
    form = dice.choice(["", "", "zip", "gztar", "bare", "nested"])
    if form in ("zip", "gztar"):
        return Path(shutil.make_archive(str(folder), form, folder.parent, folder.name))
    if form == "bare":
        with tarfile.open(folder.with_suffix(".tar"), "w") as archive:
            archive.add(folder, arcname=".")
        return folder.with_suffix(".tar")
    return folder.parent if form == "nested" else folder


def test_every_intact_part_of_a_damaged_tub_is_imported_and_nothing_wrong(tmp_path: Path) -> None:
    whole = kept = wrong = 0
    numbers = {jpeg(number): number for number in range(30)}
    for seed in range(TUBS):
        dice, home = random.Random(seed), tmp_path / str(seed)
        truth = damaged_tub(dice, home / "drives/tub")
        found: Truth = {}
        with unpacked(packed(home / "drives/tub", dice), home, ImportReport()) as path:
            try:
                drive = drive_at(path)
                write_episode(drive, home / "got.mcap")
            except RecordingError as error:
                assert not (home / "got.mcap").exists() and "skipped" in str(error)
            else:
                episode = open_episode(home / "got.mcap")
                labels = taught_labels(episode)
                found = {numbers[episode.frame(i).data]: labels.get(i) for i in episode.frames}
                times_s = [entry.captured_s for entry in episode.frames.values()]
                assert times_s == sorted(set(times_s)) and episode.duration_s < 100
                told = len(found) + len(drive.report.skipped) >= len(truth)
                assert told, drive.report.lines()
        whole += len(truth)
        kept += len(found.keys() & truth.keys())
        wrong += sum(label is not None and label != truth.get(n) for n, label in found.items())
        shutil.rmtree(home)
    print(f"{TUBS} damaged tubs: {kept} of {whole} whole examples kept, {wrong} wrong labels")
    assert whole > 5 * TUBS and kept >= 0.99 * whole and wrong == 0


@pytest.mark.parametrize("ending", ["", "\n"])
def test_the_last_row_of_a_truncated_table_is_not_imported(tmp_path: Path, ending: str) -> None:
    (tmp_path / "a.jpg").write_bytes(jpeg(1))
    (tmp_path / "b.jpg").write_bytes(jpeg(2))
    (tmp_path / "t.csv").write_text("file,angle\na.jpg,0.9\nb.jpg,-0" + ending)
    report = ImportReport()
    assert len(list(drive_at(tmp_path, report=report).shots)) == (2 if ending else 1)
    assert bool(report.skipped) is not bool(ending)


def test_skipped_pictures_are_counted_and_listed_by_reason() -> None:
    report = ImportReport()
    for number in (3, 7):
        report.skip(f"line {number}", "the record is cut")
    for number in range(1205):
        report.skip(f"record_{number}.json", "the picture is missing")
    report.remark("times repaired: 2 equal")
    assert report.lines() == [
        "times repaired: 2 equal",
        "skipped: 1207",
        "  the picture is missing: 1205, the first in record_0.json, record_1.json, record_2.json",
        "  the record is cut: line 3, line 7",
    ]
