"""Recordings of other programs become episodes; broken or hostile ones are refused with a
reason."""

from __future__ import annotations

import os
import struct
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robot.devkit.pictures import read_picture
from robot.errors import RecordingError
from robot.exchange.drive import ImportReport, write_episode
from robot.exchange.files import parse
from robot.exchange.steering import read_meant
from robot.exchange.tub_records import read_second
from robot.moves import CLASSIC, point_of
from robot.recordings.edits import Notes
from robot.recordings.episode import open_episode
from robot.recordings.teaching import count_steps
from robot.types import Action, Encoding

from .imported import drive_at, taught_labels
from .tubs import Record, jpeg, tub_1, tub_2

RECORDINGS = Path(
    os.environ.get(
        "DRIVELESSON_RECORDINGS", str(Path(__file__).parents[3].parent / "shared/recordings")
    )
)


def angles(*angles: Any, throttle: float = 0.3) -> list[Record]:
    return [{"user/angle": angle, "user/throttle": throttle} for angle in angles]


@pytest.fixture
def tub(tmp_path: Path) -> Path:
    """A tub of version 2 with one record, straight on."""
    return tub_2(tmp_path / "tub", angles(0.0))


def imported(path: Path, folder: Path, **options: Any) -> list[Action | None]:
    target = folder / "imported.mcap"
    write_episode(drive_at(path, **options), target)
    episode = open_episode(target)
    taught = taught_labels(episode)
    return [taught.get(frame_id) for frame_id in episode.frames]


def test_a_tub_of_version_1_is_read_in_the_order_of_its_numbers(tmp_path: Path) -> None:
    labels = imported(tub_1(tmp_path / "tub", angles(*[-0.9, 0.0, 0.9] * 5)), tmp_path)
    assert labels == [Action.LEFT, Action.FORWARD, Action.RIGHT] * 5
    episode = open_episode(tmp_path / "imported.mcap")
    assert episode.frame(3).data == jpeg(2)
    assert episode.frame(3).encoding is Encoding.JPEG
    assert episode.frames[15].captured_s - episode.frames[1].captured_s == pytest.approx(0.7)


def test_a_tub_of_version_2_is_read_without_its_deleted_records(tmp_path: Path) -> None:
    tub = tub_2(tmp_path / "tub", angles(-1.0, 0.1, 0.5, 0.0), deleted=(1,))
    assert imported(tub, tmp_path) == [Action.LEFT, Action.RIGHT, Action.FORWARD]
    assert open_episode(tmp_path / "imported.mcap").run["started_at_s"] == "1600000000.000"


def test_a_record_is_not_compared_with_each_that_was_deleted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compared = 0

    class Counted(int):
        def __eq__(self, other: object) -> bool:
            nonlocal compared
            compared += 1
            return int(self) == other

        __hash__ = int.__hash__

    def parse_counted(text: str) -> Any:
        found = parse(text)
        if isinstance(found, dict) and "deleted_indexes" in found:
            found["deleted_indexes"] = [Counted(n) for n in found["deleted_indexes"]]
        return found

    monkeypatch.setattr("robot.exchange.tub_records.parse", parse_counted)
    tub = tub_2(tmp_path / "tub", [{} for _ in range(400)], deleted=tuple(range(200)))
    assert len(read_second(tub, ImportReport())[0]) == 200
    assert compared < 1000


def test_the_threshold_says_what_a_turn_is_and_a_car_that_stands_teaches_nothing(
    tmp_path: Path,
) -> None:
    records = [*angles(-0.3, 0.3), *angles(0.9, throttle=0.0), *angles(0.9, throttle=-0.2)]
    tub, ahead = tub_2(tmp_path / "tub", records), Action.FORWARD
    assert imported(tub, tmp_path, threshold=0.2) == [Action.LEFT, Action.RIGHT, None, None]
    (tmp_path / "imported.mcap").unlink()
    assert imported(tub, tmp_path, threshold=0.4) == [ahead, ahead, None, None]


def test_a_tub_in_degrees_is_refused_and_its_numbers_may_be_texts(tmp_path: Path) -> None:
    tub = tub_1(tmp_path / "tub", angles(-25, 0, 20))
    with pytest.raises(RecordingError, match="'user/angle' goes from -25 to 20, not from -1 to 1"):
        drive_at(tub)
    texts = [{**one, "milliseconds": str(100 * n)} for n, one in enumerate(angles("-0.5", "0.5"))]
    drive = drive_at(tub_1(tmp_path / "texts", texts))
    assert [shot.label for shot in drive.shots] == [Action.LEFT, Action.RIGHT]
    assert [shot.t_s for shot in drive.shots] == [0.0, 0.1]


@pytest.mark.parametrize("action", [Action.FORWARD, Action.LEFT, Action.RIGHT])
def test_moves_come_back_from_their_angles(action: Action) -> None:
    point = point_of(action)
    assert point is not None and read_meant(point) == (action, point)
    assert all(move.point is not None for move in CLASSIC.values())


@pytest.mark.parametrize(
    ("table", "labels"),
    [
        ("file,label\na.jpg,left\nb.jpg,\n", [Action.LEFT, None]),
        ("file,label\r\n.\\a.jpg,left\r\nin\\b.jpg,\r\n", [Action.LEFT, None]),
        ("image,angle,throttle\na.jpg,-0.5,0.4\nb.jpg,0.1,0.4\n", [Action.LEFT, Action.FORWARD]),
        ("\ufeffPath, Steering ,t\na.jpg,0.9,10.0\nb.jpg,0,10.5\n", [Action.RIGHT, Action.FORWARD]),
    ],
)
def test_a_folder_with_a_table_is_imported(
    tmp_path: Path, table: str, labels: list[Action | None]
) -> None:
    folder = tmp_path / "folder"
    for number, name in enumerate(("a.jpg", "b.jpg")):
        for place in (folder, folder / "in"):
            place.mkdir(exist_ok=True)
            (place / name).write_bytes(jpeg(number))
    (folder / "table.csv").write_text(table, encoding="utf-8")
    assert imported(folder, tmp_path) == labels


@pytest.mark.recordings
@pytest.mark.skipif(not RECORDINGS.is_dir(), reason=f"no footage in {RECORDINGS}")
def test_a_recording_of_the_evaluation_is_imported(tmp_path: Path) -> None:
    path = RECORDINGS / "asphalt_A.npz"
    write_episode(drive_at(path), tmp_path / "a.mcap")
    episode = open_episode(tmp_path / "a.mcap")
    assert len(episode.frames) == count_steps([(episode, Notes())]) == 700


# Hostile -----------------------------------------------------------------------------------------


def refused(path: Path, folder: Path, complaint: str) -> None:
    target = folder / "x.mcap"
    before = sorted(p for p in folder.rglob("*"))
    with pytest.raises(RecordingError, match=complaint):
        write_episode(drive_at(path), target)
    assert sorted(p for p in folder.rglob("*")) == before


@pytest.mark.parametrize(
    "name",
    [
        *("../secret.jpg", "a/../../secret.jpg", "..\\secret.jpg", "/etc/hostname"),
        *("link.jpg", "loop.jpg", "pipe.jpg"),
    ],
)
def test_a_picture_outside_of_the_tub_is_not_read(tmp_path: Path, name: str) -> None:
    (tmp_path / "secret.jpg").write_bytes(jpeg(1))
    tub = tub_2(tmp_path / "tub", [{"user/angle": 0.0, "cam/image_array": name}])
    for link, target in (("link.jpg", tmp_path / "secret.jpg"), ("loop.jpg", "loop.jpg")):
        (tub / "images" / link).symlink_to(target)
    if name == "pipe.jpg":
        os.mkfifo(tub / "images" / name)
    refused(tub, tmp_path, "leads out of|cannot be read")


def test_a_catalog_outside_of_the_tub_is_not_read(tub: Path, tmp_path: Path) -> None:
    text = (tub / "manifest.json").read_text()
    (tub / "manifest.json").write_text(text.replace("catalog_0.catalog", "../x.catalog"))
    refused(tub, tmp_path, "leads out of")


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
        jpeg(1)[:20],
        b"\xff\xd8\xff\xc0\x00\x11\x08\x00\x78\x00\xa0" + b"\0" * 40,
        b"GIF89a" + b"\0" * 40,
        png_claiming(60_000, 60_000),
        png_claiming(2_000, 2_000)[:-400],
        png_claiming(0, 5),
    ],
)
def test_an_image_that_is_no_image_is_refused(tub: Path, tmp_path: Path, data: bytes) -> None:
    with pytest.raises(RecordingError, match="x"):
        read_picture(data, "x")
    (tub / "images" / "0_cam_image_array_.jpg").write_bytes(data)
    refused(tub, tmp_path, "picture|pixels")


def test_a_link_to_a_picture_of_the_tub_is_read(tmp_path: Path) -> None:
    tub = tub_2(tmp_path / "tub", [{"user/angle": 0.0, "cam/image_array": "link.jpg"}])
    (tub / "images" / "deep").mkdir()
    (tub / "images" / "deep" / "a.jpg").write_bytes(jpeg(1))
    (tub / "images" / "link.jpg").symlink_to("deep/a.jpg")
    assert imported(tub, tmp_path) == [Action.FORWARD]


@pytest.mark.parametrize("turn", range(1, 9))
@pytest.mark.parametrize("preview", [b"", jpeg(1)])
def test_a_picture_with_an_orientation_tag_is_not_taken_for_damaged(
    turn: int, preview: bytes
) -> None:
    """imagesize 1.4 returns the sides as stored, so that turned pictures seemed damaged. A preview
    in the header has sides and scans of its own."""
    plain = jpeg(2)
    entry = struct.pack("<HHIHH", 0x112, 3, 1, turn, 0)  # the orientation, one short number
    exif = b"Exif\0\0II*\0" + struct.pack("<IH", 8, 1) + entry + bytes(4) + preview
    marked = plain[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + plain[2:]
    picture = read_picture(marked, "x")
    assert (picture.width, picture.height) == ((160, 120) if turn < 5 else (120, 160))


@pytest.mark.parametrize(
    "manifest", ["", "{}", "[]\n[]\n{}\n{}\n", "[]\n[]\n{}\n{}\n[]\n", "[" * 10_000]
)
def test_a_tub_without_a_manifest_is_read_by_its_catalogs(tmp_path: Path, manifest: str) -> None:
    tub = tub_2(tmp_path / "tub", angles(0.0, -1.0))
    (tub / "manifest.json").write_text(manifest)
    assert imported(tub, tmp_path) == [Action.FORWARD, Action.LEFT]
    with pytest.raises(RecordingError, match="it is lost"):
        drive_at(tub, report=ImportReport(is_strict=True))


@pytest.mark.parametrize(
    "record", ["{", "[]", "{}", '{"cam/image_array": 7}', "null", '{"user/angle": "left"}']
)
def test_a_broken_record_is_refused(tub: Path, tmp_path: Path, record: str) -> None:
    (tub / "catalog_0.catalog").write_text(record + "\n")
    refused(tub, tmp_path, "catalog|user/angle")


@pytest.mark.parametrize(
    "table",
    [
        *("", "file,label\n", "a,b\n1,2\n", "file\na.jpg\n"),
        *("file,angle\na.jpg,nan\n", "file,label\na.jpg,fly\n"),
        *("file,label\n../secret.jpg,left\n", "file,label\nmissing.jpg,left\n"),
        "file,label\n" + "x" * 200_000 + ",left\n",
    ],
)
def test_a_broken_table_is_refused(tmp_path: Path, table: str) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    (tmp_path / "secret.jpg").write_bytes(jpeg(1))
    (folder / "a.jpg").write_bytes(jpeg(1))
    (folder / "table.csv").write_text(table)
    refused(folder, tmp_path, "table|picture|leads out")


def test_an_unknown_format_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.txt").write_text("x")
    refused(tmp_path / "x.txt", tmp_path, "text, but no table that names pictures")
    refused(tmp_path / "missing", tmp_path, "missing does not exist")


def test_an_npz_with_pickles_or_a_bomb_is_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "x.npz", labels=np.array([print], dtype=object), allow_pickle=True)
    refused(tmp_path / "x.npz", tmp_path, "x.npz")
    with zipfile.ZipFile(tmp_path / "x.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("jpeg.npy", bytes(600 * 2**20))
    refused(tmp_path / "x.npz", tmp_path, "512 MB")
