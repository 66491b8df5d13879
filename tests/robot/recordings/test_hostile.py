"""Malicious files are refused, or read up to the malicious part, and never trusted."""

from __future__ import annotations

import resource
import struct
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest
import zstandard
from mcap.writer import CompressionType, Writer

from robot.errors import RecordingError
from robot.recordings.episode import open_episode
from robot.recordings.messages import RUN, SUMMARY
from robot.recordings.summary import read_summary
from tests.kit.sizes import crossed

from .drives import record_drive

MAGIC = b"\x89MCAP0\r\n"


@pytest.fixture(autouse=True)
def _little_memory() -> Iterator[None]:
    """Limit the memory, so that code that trusts an absurd length runs out of it."""
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + 600 * 2**20, hard))
    yield
    resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def record(opcode: int, body: bytes, length: int | None = None) -> bytes:
    return struct.pack("<BQ", opcode, len(body) if length is None else length) + body


def text(value: bytes, length: int | None = None) -> bytes:
    return struct.pack("<I", len(value) if length is None else length) + value


def chunk(data: bytes, claims: int, compression: bytes = b"zstd", crc: int = 0) -> bytes:
    head = struct.pack("<QQQI", 0, 0, claims, crc)
    return record(6, head + text(compression) + struct.pack("<Q", len(data)) + data)


def beginning(folder: Path) -> bytes:
    """Return the bytes of a real recording up to its first chunk."""
    data = record_drive(folder / "real", frames=5).path.read_bytes()
    at = len(MAGIC)
    while data[at] != 6:
        at += 9 + struct.unpack_from("<Q", data, at + 1)[0]
    return data[:at]


def is_damaged(folder: Path, record: bytes) -> str:
    """Return the damage that is reported of a recording whose next record is this one."""
    path = folder / "x.mcap"
    path.write_bytes(beginning(folder) + record)
    assert read_summary(path).damage
    return str(open_episode(path).damage or "")


@crossed(length=[2**63, 2**40, 2**32, 300 * 2**20], opcode=[1, 3, 4, 5, 6, 9, 12, 0x7F])
def test_absurd_lengths_end_the_reading(tmp_path: Path, opcode: int, length: int) -> None:
    assert is_damaged(tmp_path, record(opcode, b"\0" * 64, length))


@pytest.mark.parametrize("opcode", [1, 3, 4, 9, 12])
def test_absurd_lengths_inside_a_record_end_the_reading(tmp_path: Path, opcode: int) -> None:
    body = b"\x01\0" + text(b"x", 2**32 - 1) * 4 + b"\0" * 64
    assert is_damaged(tmp_path, record(opcode, body))


def test_a_chunk_is_bounded_by_its_own_length_and_by_what_it_may_unpack_to(tmp_path: Path) -> None:
    inside, small = record(5, b"\0" * 30, 2**60), zstandard.compress(bytes(200 * 2**20))
    assert is_damaged(tmp_path, chunk(inside, len(inside), b""))
    assert len(small) < 2**16
    for claims in (2**62, 200 * 2**20):
        assert "claims to unpack" in is_damaged(tmp_path, chunk(small, claims))
    assert "another size" in is_damaged(tmp_path, chunk(small, 1000))


def test_a_footer_that_points_elsewhere_is_not_followed(tmp_path: Path) -> None:
    data = record_drive(tmp_path).path.read_bytes()
    path = tmp_path / "x.mcap"
    for start in (0, 7, len(data) - 5, 2**63, 2**40):
        path.write_bytes(data[:-28] + struct.pack("<QQI", start, 0, 0) + MAGIC)
        assert read_summary(path).frames > 50


@pytest.mark.parametrize("data", [b"", b"\x89MCAP", b"PK\x03\x04" + b"\0" * 99, MAGIC, MAGIC * 9])
def test_a_file_that_is_not_a_recording_is_refused_with_a_reason(
    tmp_path: Path, data: bytes
) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(data)
    with pytest.raises(RecordingError, match=r"x\.mcap"):
        open_episode(path)
    summary = read_summary(path)
    assert not summary.is_readable and summary.damage


def crafted(
    path: Path,
    metadata: dict[str, dict[str, str]],
    channel: tuple[str, str, str] = ("/x", "json", "x"),
    messages: Iterable[bytes] = (),
) -> Path:
    """Write a file by the library itself; a channel is a topic, an encoding and a schema."""
    topic, encoding, schema = channel
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start()
        for name, values in metadata.items():
            writer.add_metadata(name, values)
        schema_id = writer.register_schema(schema, encoding.replace("json", "jsonschema"), b"{}")
        channel_id = writer.register_channel(topic, encoding, schema_id)
        for i, data in enumerate(messages):
            writer.add_message(channel_id, 1, data, 1, i)
        writer.finish()
    return path


OURS = {RUN: {"format": "1", "origin_ns": "0"}}


def test_a_recording_of_another_program_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="not a recording of this program"):
        open_episode(crafted(tmp_path / "other.mcap", {}, messages=[b"{}"]))


TAUGHT = b'{"event": "taught", "frame": 1, "label": "left", "intervention": false, "at_s": 0'


@pytest.mark.parametrize(
    "words",
    [
        *(b"[]", b"{", b"[" * 100_000, b'{"event": "taught", "frame": "x"}'),
        TAUGHT.replace(b"left", b"Fly away") + b"}",
        TAUGHT + b', "x": {"dtype": "O", "shape": [1], "data": ""}}',
        TAUGHT + b', "x": {"dtype": "<f4", "shape": [99999999999], "data": "AAAA"}}',
    ],
    ids=lambda words: words[:20],
)
def test_texts_of_another_form_end_the_reading(tmp_path: Path, words: bytes) -> None:
    path = crafted(tmp_path / "x.mcap", OURS, ("/lesson", "json", "x"), [words])
    assert open_episode(path).damage


def test_an_invalid_picture_is_reported(tmp_path: Path) -> None:
    pictures = (b"\xff" * 40, b"\x32\xff\xff\xff\xff\x0f", b"", b"\x0a\x05")
    channel = ("/camera", "protobuf", "foxglove.RawImage")
    episode = open_episode(crafted(tmp_path / "x.mcap", OURS, channel, pictures))
    for frame_id in range(4):
        with pytest.raises(RecordingError, match="damaged"):
            episode.frame(frame_id)


@pytest.mark.parametrize("began", ["1e300", "-1e300", "nan", "inf", "yesterday"])
def test_a_time_that_no_list_can_show_is_refused(tmp_path: Path, began: str) -> None:
    summary = {"duration_s": "1", "frames": "1", "taught": "{}"}
    metadata = {RUN: OURS[RUN] | {"started_at_s": began}, SUMMARY: summary}
    path = crafted(tmp_path / "x.mcap", metadata)
    found = read_summary(path)
    assert (found.is_readable, found.started_at_s) == (False, 0.0)
    with pytest.raises(RecordingError, match=r"x\.mcap"):
        open_episode(path)
