"""Every intact record of a donkeycar tub is imported, even if the tub is damaged or hostile."""

from __future__ import annotations

import json
import os
import struct
import zlib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from robot.devkit.pictures import read_picture
from robot.errors import RecordingError
from robot.exchange.drive import ImportReport, write_episode
from robot.recordings.episode import open_episode, taught_frames
from robot.types import Action, Encoding
from tests.kit.sizes import IS_FULL

from .imported import Record, drive_at, import_from, labels_by_number, picture, tub_1, tub_2

L, F, R = Action.LEFT, Action.FORWARD, Action.RIGHT


def angles(*angles: Any, throttle: float = 0.3) -> list[Record]:
    return [{"user/angle": angle, "user/throttle": throttle} for angle in angles]


@pytest.fixture
def tub(tmp_path: Path) -> Path:
    """A tub of version 2 with one record, straight on."""
    return tub_2(tmp_path / "tub", angles(0.0))


def imported(path: Path, **reading: Any) -> dict[int, Action | None]:
    target = path.with_suffix(".mcap")
    target.unlink(missing_ok=True)
    return labels_by_number(import_from(path, target, **reading))


def test_a_tub_of_version_1_is_read_in_the_order_of_its_numbers_as_far_as_it_is_whole(
    tmp_path: Path,
) -> None:
    tub = tub_1(tmp_path / "tub", angles(*[-0.9, 0.0, 0.9] * 4))
    (tub / "record_9.json").write_text('{"user/an')
    (tub / "10_cam_image_array_.jpg").unlink()
    episode = import_from(tub, tmp_path / "got.mcap")
    whole = [(n, label) for n, label in enumerate([L, F, R] * 4, 1) if n not in (10, 11)]
    assert list(labels_by_number(episode).items()) == whole
    assert episode.frame(3).data == picture(3)
    assert episode.frame(3).encoding is Encoding.JPEG
    assert episode.frames[10].captured_s - episode.frames[1].captured_s == pytest.approx(0.55)


def test_a_tub_of_version_2_is_read_without_its_deleted_records(tmp_path: Path) -> None:
    tub = tub_2(tmp_path / "tub", angles(-1.0, 0.1, 0.5, 0.0), deleted=(1,))
    assert imported(tub) == {1: L, 3: R, 4: F}
    assert open_episode(tmp_path / "tub.mcap").run["started_at_s"] == "1600000000.000"


def test_the_threshold_says_what_a_turn_is_and_a_car_that_stands_teaches_nothing(
    tmp_path: Path,
) -> None:
    records = [*angles(-0.3, 0.3), *angles(0.9, throttle=0.0), *angles(0.9, throttle=-0.2)]
    tub = tub_2(tmp_path / "tub", records)
    assert imported(tub, threshold=0.2) == {1: L, 2: R, 3: None, 4: None}
    assert imported(tub, threshold=0.4) == {1: F, 2: F, 3: None, 4: None}


@pytest.mark.parametrize("full_lock", [1.0, 32767.0])
def test_a_stick_that_goes_slightly_beyond_one_steers_fully(
    full_lock: float, tmp_path: Path
) -> None:
    """A stick reports numbers from -32768 to 32767."""
    share = -32768 / 32767
    tub = tub_2(tmp_path / "tub", angles(share * full_lock, 0, full_lock, throttle=-share))
    assert imported(tub, full_lock=full_lock) == {1: L, 2: F, 3: R}
    taught = taught_frames(open_episode(tmp_path / "tub.mcap")).values()
    assert [each.point for each in taught] == [(-1, 1), (0, 1), (1, 1)]


def test_a_tub_of_a_clock_that_began_in_1970_has_no_date(tmp_path: Path) -> None:
    records = [{**one, "_timestamp_ms": 300_000 + n} for n, one in enumerate(angles(-0.3, 0.3))]
    assert imported(tub_2(tmp_path / "tub", records)) == {1: L, 2: R}
    assert open_episode(tmp_path / "tub.mcap").started_at_s == 0.0


def test_a_tub_whose_milliseconds_are_seconds_keeps_its_pace_and_date(tmp_path: Path) -> None:
    records = [
        {**one, "_timestamp_ms": 1_600_000_000 + n / 10} for n, one in enumerate(angles(-1, 0, 1))
    ]
    assert imported(tub_2(tmp_path / "tub", records)) == {1: L, 2: F, 3: R}
    episode = open_episode(tmp_path / "tub.mcap")
    assert episode.duration_s == pytest.approx(0.2) and episode.started_at_s == 1_600_000_000


def test_a_tub_in_degrees_is_refused_and_its_numbers_and_times_may_be_texts(tmp_path: Path) -> None:
    tub = tub_1(tmp_path / "tub", angles(-25, 0, 20))
    with pytest.raises(RecordingError, match="'user/angle' goes from -25 to 20, not from -1 to 1"):
        drive_at(tub)
    for name, clock in (("milliseconds", "{}00"), ("timestamp", "2019-04-05 20:43:31.{}")):
        records = [
            {**one, "milliseconds": None, name: clock.format(n)}
            for n, one in enumerate(angles("-0.5", "0.5"))
        ]
        drive = drive_at(tub_1(tmp_path / name, records))
        assert [shot.label for shot in drive.shots] == [L, R]
        first_s, second_s = (float(str(shot.t_s)) for shot in drive.shots)
        assert second_s - first_s == pytest.approx(0.1, abs=1e-4)


# Damaged -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["user/angle", "user/throttle"])
def test_a_record_whose_number_is_none_is_skipped(tmp_path: Path, name: str) -> None:
    bad = (None, float("nan"), float("inf"), "left", True, [], {}, 37.0, 10**400, "")
    records = [{**one, name: value} for one, value in zip(angles(*[0.0] * 10), bad, strict=True)]
    assert imported(tub_2(tmp_path / "tub", [*records, *angles(0.0)])) == {11: F}


def test_what_the_autopilot_drove_teaches_nothing(tmp_path: Path) -> None:
    modes = ("user", "local", "pilot", None, 7)
    records = [{**one, "user/mode": m} for one, m in zip(angles(*[0.0] * 5), modes, strict=True)]
    assert imported(tub_2(tmp_path / "tub", records)) == {1: F, **dict.fromkeys(range(2, 6))}


FIRST, SECOND, MANIFEST = "catalog_0.catalog", "catalog_1.catalog", "manifest.json"
DAMAGES: dict[str, tuple[str, bytes, bytes, set[int]]] = {
    "no angle": (FIRST, b'"user/angle": 0.0, ', b"", {2, 5}),
    "moved": (FIRST, b'array": "1_', b'array": "/home/pi/mycar/data/images/1_', set()),
    "moved on Windows": (FIRST, b'array": "3_', rb'array": "C:\\cars\\data\\images\\3_', set()),
    "no time": (SECOND, b'ms": 1600000000', b'ms": NaN, "": 1600000000', set()),
    "an impossible time": (FIRST, b'ms": 1600000000', b'ms": -1600000000', set()),
    "a cut record": (SECOND, b'throttle": 0.3, "cam/image_array": "6_', b"", {7}),
    "a cut record without its line break": (SECOND, b'"_timestamp_ms": 1600000000700}\n', b"", {8}),
    "zeros in a record": (SECOND, b'"_index": 9,', bytes(50) + b"\xff\xfe", {10}),
    "lost line breaks": (SECOND, b"\n", b"", set()),
    "no deleted records": (MANIFEST, b'indexes": []', b'indexes": null', set()),
    "moved catalogs": (MANIFEST, b'"catalog_', b'"/home/pi/mycar/data/catalog_', set()),
    "no catalogs": (MANIFEST, b'{"paths"', b'["paths"', set()),
    "a deeply nested manifest": (MANIFEST, b"[", b"[" * 10_000, set()),
}
"""Kinds of damage: the file, the replaced text, the replacement, and the lost pictures."""


@pytest.mark.parametrize("first", DAMAGES)
def test_every_intact_record_of_a_damaged_tub_is_imported_and_nothing_wrong(
    tmp_path: Path, first: str
) -> None:
    """Try each damage by itself and with the next one, or at full size with each later one."""
    names = list(DAMAGES)
    for second in names[names.index(first) :][: None if IS_FULL else 2]:
        tub, report = tub_2(tmp_path / second, angles(*[-0.7, 0.0, 0.6] * 4)), ImportReport()
        lost = set[int]()
        for file, old, new, pictures in (DAMAGES[name] for name in {first: 1, second: 1}):
            data = (tub / file).read_bytes()
            assert old in data or first != second
            (tub / file).write_bytes(data.replace(old, new))
            lost |= pictures if old in data else set()
        write_episode(drive_at(tub, report), tmp_path / f"{second}.mcap")
        episode = open_episode(tmp_path / f"{second}.mcap")
        truth = {n: label for n, label in enumerate([L, F, R] * 4, 1) if n not in lost}
        assert labels_by_number(episode) == truth, (second, report.lines())
        times_s = [entry.captured_s for entry in episode.frames.values()]
        assert times_s == sorted(set(times_s)) and episode.duration_s < 100, second
        assert report.skipped or not lost, second


def test_with_the_option_strict_damage_is_an_error(tub: Path) -> None:
    (tub / "manifest.json").write_text("")
    with pytest.raises(RecordingError, match="it is missing or damaged"):
        drive_at(tub, report=ImportReport(is_strict=True))


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


# Hostile -----------------------------------------------------------------------------------------


def name_picture(tub: Path, name: str) -> None:
    record = json.loads((tub / FIRST).read_text())
    (tub / FIRST).write_text(json.dumps({**record, "cam/image_array": name}) + "\n")


def refused(tub: Path, complaint: str) -> None:
    """The import refuses the drive, and leaves nothing behind."""
    before = sorted(tub.parent.rglob("*"))
    with pytest.raises(RecordingError, match=complaint):
        import_from(tub, tub.parent / "x.mcap")
    assert sorted(tub.parent.rglob("*")) == before


@pytest.mark.parametrize(
    "name",
    [
        *("../secret.jpg", "a/../../secret.jpg", "..\\secret.jpg", "/etc/hostname"),
        *("link.jpg", "loop.jpg", "pipe.jpg"),
    ],
)
def test_a_picture_outside_of_the_tub_is_not_read(tub: Path, name: str) -> None:
    name_picture(tub, name)
    (tub.parent / "secret.jpg").write_bytes(picture(1))
    for link, target in (("link.jpg", tub.parent / "secret.jpg"), ("loop.jpg", "loop.jpg")):
        (tub / "images" / link).symlink_to(target)
    if name == "pipe.jpg":
        os.mkfifo(tub / "images" / name)
    refused(tub, "leads out of|cannot be read")


def test_a_link_to_a_picture_of_the_tub_is_read(tub: Path) -> None:
    name_picture(tub, "link.jpg")
    (tub / "images/deep").mkdir()
    (tub / "images/deep/a.jpg").write_bytes(picture(2))
    (tub / "images/link.jpg").symlink_to("deep/a.jpg")
    assert imported(tub) == {2: F}


@pytest.mark.parametrize("name", ["../x.catalog", "a\0b.catalog", "\ud800.catalog", "x" * 300])
def test_a_catalog_outside_of_the_tub_or_without_a_valid_name_is_not_read(
    tub: Path, name: str
) -> None:
    (tub.parent / "x.catalog").write_bytes((tub / FIRST).read_bytes())
    text = (tub / MANIFEST).read_text()
    (tub / MANIFEST).write_text(text.replace(f'"{FIRST}"', json.dumps(name)))
    refused(tub, "leads out of" if ".." in name else "cannot be read")


@pytest.mark.parametrize(
    "record", ["{", "[]", "{}", '{"cam/image_array": 7}', "null", '{"user/angle": "left"}']
)
def test_a_broken_record_is_refused(tub: Path, record: str) -> None:
    (tub / "catalog_0.catalog").write_text(record + "\n")
    refused(tub, "catalog|user/angle")


def png_claiming(width: int, height: int) -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    data = zlib.compress(bytes(10**6))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"no picture at all",
        b"\xff\xd8\xff\xe0" + b"\0" * 50,
        picture(1)[:20],
        picture(1)[:-1],
        b"\xff\xd8\xff\xc0\x00\x11\x08\x00\x78\x00\xa0" + b"\0" * 40,
        b"GIF89a" + b"\0" * 40,
        png_claiming(60_000, 60_000),
        png_claiming(2_000, 2_000)[:-400],
        png_claiming(0, 5),
    ],
)
def test_a_file_that_is_not_an_image_is_refused(tub: Path, data: bytes) -> None:
    with pytest.raises(RecordingError, match="x"):
        read_picture(data, "x")
    (tub / "images/0_cam_image_array_.jpg").write_bytes(data)
    refused(tub, "picture|pixels")


@pytest.mark.parametrize("preview", [b"", picture(1)])
def test_a_picture_with_an_orientation_tag_is_not_taken_for_damaged(preview: bytes) -> None:
    """imagesize 1.4 returns the stored sides, so turned pictures seemed damaged. A preview in the
    header has its own sides and scans."""
    plain = picture(2)
    for turn in range(1, 9):
        entry = struct.pack("<HHIHH", 0x112, 3, 1, turn, 0)  # the orientation, a short integer
        exif = b"Exif\0\0II*\0" + struct.pack("<IH", 8, 1) + entry + bytes(4) + preview
        marked = plain[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + plain[2:]
        found = read_picture(marked, "x")
        assert (found.width, found.height) == ((160, 120) if turn < 5 else (120, 160)), turn


def test_a_jpeg_with_appended_bytes_is_whole_and_a_png_may_be_turned() -> None:
    """Phones append a film to a picture, and some programs store the orientation of a PNG."""
    shown = np.arange(64 * 48 * 3, dtype=np.uint8).reshape(48, 64, 3)
    for progressive in (0, 1):
        data = cv2.imencode(".jpg", shown, [cv2.IMWRITE_JPEG_PROGRESSIVE, progressive])[1].tobytes()
        film = b"ftypmp42 \xff\xda and more"
        assert read_picture(data + film, "x").data == data + film
        with pytest.raises(RecordingError, match="its end is missing"):
            read_picture(data[:-9] + film, "x")
    png = cv2.imencode(".png", shown)[1].tobytes()
    turned = b"eXIf" + b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06" + bytes(6)
    chunk = (len(turned) - 4).to_bytes(4, "big") + turned + zlib.crc32(turned).to_bytes(4, "big")
    found = read_picture(png[:33] + chunk + png[33:], "x")
    assert (found.width, found.height) == (48, 64)
