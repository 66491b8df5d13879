"""Damaged tubs and tables: every intact part is imported, and nothing wrong is taught."""

from __future__ import annotations

import json
import random
import shutil
import tarfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from robot.errors import RecordingError
from robot.exchange.drive import ImportReport, write_episode
from robot.exchange.sources import unpacked
from robot.recordings.episode import open_episode
from robot.types import Action
from tests.kit.sizes import size
from tests.robot.exchange.imported import drive_at, taught_labels

TUBS = size("TUBS", 12, 500)
LABELS = {-0.7: Action.LEFT, 0.0: Action.FORWARD, 0.6: Action.RIGHT}


def picture(number: int) -> bytes:
    pixels = np.random.default_rng(number).integers(0, 256, (12, 16, 3), dtype=np.uint8)
    return cv2.imencode(".jpg", pixels)[1].tobytes()


@dataclass
class Tub:
    """A tub before it is written, and its true content."""

    dice: random.Random
    records: list[dict[str, Any]] = field(default_factory=list)
    pictures: dict[int, bytes | None] = field(default_factory=dict)
    truth: dict[int, Action | None] = field(default_factory=dict)
    """The label of each intact record."""
    catalogs: list[str] = field(default_factory=list)
    lines: dict[str, bytes] = field(default_factory=dict)
    manifest: bytes | None = b""
    is_first: bool = False

    def spoil(self, number: int) -> None:
        self.truth.pop(number, None)


def whole_tub(dice: random.Random, *, is_first: bool) -> Tub:
    tub = Tub(dice, is_first=is_first)
    for number in range(dice.randint(6, 30)):
        angle = dice.choice(list(LABELS))
        tub.records.append(
            {
                "_index": number,
                "_timestamp_ms": 1_600_000_000_000 + 50 * number,
                "cam/image_array": f"{number}_cam_image_array_.jpg",
                "user/angle": angle,
                "user/throttle": 0.4,
                "user/mode": "user",
            }
        )
        tub.pictures[number] = picture(number)
        tub.truth[number] = LABELS[angle]
    return tub


# On records, before they are written


def bad_pictures(tub: Tub) -> None:
    number = tub.dice.randrange(len(tub.records))
    whole = picture(number)
    tub.pictures[number] = tub.dice.choice(
        [None, b"", whole[:-1], whole[: len(whole) // 2], whole[:99] + bytes(len(whole)), b"GIF89a"]
    )
    tub.spoil(number)


def bad_numbers(tub: Tub) -> None:
    number = tub.dice.randrange(len(tub.records))
    bad = [None, float("nan"), float("inf"), -float("inf"), "left", True, [], {}, 37.0, 10**400, ""]
    tub.records[number][tub.dice.choice(["user/angle", "user/throttle"])] = tub.dice.choice(bad)
    tub.spoil(number)


def no_angle(tub: Tub) -> None:
    number = tub.dice.randrange(len(tub.records))
    del tub.records[number]["user/angle"]
    tub.spoil(number)


def autopilot(tub: Tub) -> None:
    first = tub.dice.randrange(len(tub.records))
    mode = tub.dice.choice(["local", "local_angle", "pilot", "auto", None, 7])
    for number in range(first, len(tub.records)):
        tub.records[number].update({"user/mode": mode, "user/angle": 0, "user/throttle": 0.4})
        if number in tub.truth:
            tub.truth[number] = None


def moved(tub: Tub) -> None:
    home = tub.dice.choice(["/home/pi/mycar/data/images/", "C:\\cars\\data\\images\\"])
    for record in tub.records:
        if isinstance(record["cam/image_array"], str):
            record["cam/image_array"] = home + record["cam/image_array"]


def strange_times(tub: Tub) -> None:
    for record in tub.records[tub.dice.randrange(len(tub.records)) :]:
        strange = [0, None, "x", -5, float("nan"), 10**30, 1_600_000_000_000, 1e12, True]
        record["_timestamp_ms"] = tub.dice.choice(strange)


# On the text of catalogs and manifest (version 2)


def any_catalog(tub: Tub) -> tuple[str, list[int]]:
    place = tub.dice.randrange(len(tub.catalogs))
    return tub.catalogs[place], list(range(10 * place, min(10 * place + 10, len(tub.records))))


def lost_catalog(tub: Tub) -> None:
    name, numbers = any_catalog(tub)
    tub.lines.pop(name, None)
    for number in numbers:
        tub.spoil(number)


def cut_line(tub: Tub) -> None:
    name, numbers = any_catalog(tub)
    lines = tub.lines.get(name, b"").splitlines(keepends=True)
    if len(lines) == len(numbers):  # no line break is lost yet
        place = tub.dice.randrange(len(lines))
        ending = tub.dice.choice([b"", b"\n", bytes(50), b"\xff\xfe\n"])
        lines[place] = lines[place][: tub.dice.randint(1, len(lines[place]) - 3)] + ending
        tub.lines[name] = b"".join(lines)
        tub.spoil(numbers[place])


def lost_line_breaks(tub: Tub) -> None:
    name, _ = any_catalog(tub)
    if name in tub.lines:
        tub.lines[name] = tub.lines[name].replace(b"\n", b"")


def spoilt_manifest(tub: Tub) -> None:
    text = tub.manifest or b"\n" * 5
    deleted = text.replace(b'"deleted_indexes": []', b'"deleted_indexes": null')
    moved = text.replace(b'"catalog_', b'"/home/pi/mycar/data/catalog_')
    cut = text[: tub.dice.randrange(len(text))]
    tub.manifest = tub.dice.choice([None, b"", b"\0" * 90, cut, deleted, moved, b"[]\n" * 5])


ON_RECORDS = [bad_pictures, bad_numbers, no_angle, autopilot, moved, strange_times]
ON_TEXT = [lost_catalog, cut_line, lost_line_breaks, spoilt_manifest]


def write(tub: Tub, folder: Path, damages: list[Callable[[Tub], None]]) -> None:
    images = folder if tub.is_first else folder / "images"
    images.mkdir(parents=True)
    for number, data in tub.pictures.items():
        if data is not None:
            (images / f"{number}_cam_image_array_.jpg").write_bytes(data)
    if tub.is_first:
        for number, record in enumerate(tub.records):
            (folder / f"record_{number}.json").write_text(json.dumps(record))
        return
    for start in range(0, len(tub.records), 10):
        name = f"catalog_{start // 10}.catalog"
        tub.catalogs.append(name)
        text = "".join(json.dumps(record) + "\n" for record in tub.records[start : start + 10])
        tub.lines[name] = text.encode()
    catalogs = {"paths": tub.catalogs, "current_index": len(tub.records), "deleted_indexes": []}
    lines = [["cam/image_array"], ["image_array"], {}, {}, catalogs]
    tub.manifest = "".join(json.dumps(line) + "\n" for line in lines).encode()
    for damage in damages:
        damage(tub)
    for name, data in tub.lines.items():
        (folder / name).write_bytes(data)
    if tub.manifest is not None:
        (folder / "manifest.json").write_bytes(tub.manifest)


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


def test_of_any_damaged_tub_what_is_whole_is_taken_and_nothing_wrong(tmp_path: Path) -> None:
    whole = kept = wrong = 0
    numbers = {picture(number): number for number in range(30)}
    for seed in range(TUBS):
        dice = random.Random(seed)
        tub = whole_tub(dice, is_first=dice.random() < 0.25)
        for damage in dice.choices(ON_RECORDS, k=dice.randint(0, 3)):
            damage(tub)
        home = tmp_path / str(seed)
        write(tub, home / "drives/tub", dice.choices(ON_TEXT, k=dice.randint(0, 2)))
        found: dict[int, Action | None] = {}
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
                told = len(found) + len(drive.report.skipped) >= len(tub.truth)
                assert told, drive.report.lines()
        whole += len(tub.truth)
        kept += len(found.keys() & tub.truth.keys())
        wrong += sum(label is not None and label != tub.truth.get(n) for n, label in found.items())
        shutil.rmtree(home)
    print(f"{TUBS} damaged tubs: {kept} of {whole} whole examples kept, {wrong} wrong labels")
    assert whole > 5 * TUBS and kept >= 0.99 * whole and wrong == 0


@pytest.mark.parametrize("ending", ["", "\n"])
def test_the_last_row_of_a_table_that_was_cut_is_not_believed(tmp_path: Path, ending: str) -> None:
    (tmp_path / "a.jpg").write_bytes(picture(1))
    (tmp_path / "b.jpg").write_bytes(picture(2))
    (tmp_path / "t.csv").write_text("file,angle\na.jpg,0.9\nb.jpg,-0" + ending)
    report = ImportReport()
    assert len(list(drive_at(tmp_path, report=report).shots)) == (2 if ending else 1)
    assert bool(report.skipped) is not bool(ending)


def test_what_was_skipped_is_counted_and_listed_by_reason() -> None:
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
