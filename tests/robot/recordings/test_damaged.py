"""Damaged and malicious files are read up to the damage, and truncated files are completed."""

from __future__ import annotations

import random
import struct
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest
import zstandard
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from robot.errors import RecordingError, RobotError
from robot.policy.registry import make_policy
from robot.recordings.edits import Notes
from robot.recordings.ending import end_recording
from robot.recordings.episode import open_episode, taught_frames
from robot.recordings.messages import RUN, SUMMARY
from robot.recordings.reader import Cut, Message, read_metadata, scan
from robot.recordings.summary import read_summary
from robot.recordings.teaching import learn_again
from tests.kit.sizes import crossed, seeds

from .drives import RecordedBench, record_drive

Messages = list[tuple[str, int, bytes]]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A drive of several flushes, with an undo."""
    robot = RecordedBench(tmp_path_factory.mktemp("drive"))
    robot.drive(range(60))
    robot.undo(0.7)
    robot.drive(range(60, 130))
    return robot.finish()[0].read_bytes()


@pytest.fixture(scope="module")
def true(whole: bytes, tmp_path_factory: pytest.TempPathFactory) -> set[tuple[int, bytes]]:
    """The messages of the whole drive, without their topics."""
    path = tmp_path_factory.mktemp("whole") / "x.mcap"
    path.write_bytes(whole)
    return {message[1:] for message in messages(path)}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "x.mcap"


def messages(path: Path) -> Messages:
    return [(m.topic, m.log_ns, m.data) for m in scan(path) if isinstance(m, Message)]


def by_library(path: Path) -> Messages:
    """Read all messages with the library itself, which uses the index."""
    with path.open("rb") as file:
        found = make_reader(file, validate_crcs=True).iter_messages()
        return [(channel.topic, message.log_time, message.data) for _, channel, message in found]


@pytest.mark.parametrize("seed", seeds(6, 60))
def test_a_cut_recording_is_read_up_to_the_cut_and_gets_its_end(
    path: Path, whole: bytes, seed: int
) -> None:
    path.write_bytes(whole)
    episode = open_episode(path)
    pictures = [(i, episode.frame(i).data) for i in episode.frames]
    cut = random.Random(seed).randrange(1, len(whole) if seed % 3 else 2500)
    path.write_bytes(whole[: -cut if seed % 3 == 0 else cut])
    counted, held = read_summary(path), messages(path) if path.stat().st_size > 8 else []
    if counted.is_readable:
        episode = open_episode(path)
        taught = Counter(str(example.label) for example in taught_frames(episode).values())
        assert counted.damage == episode.damage
        assert (counted.frames, counted.taught) == (len(episode.frames), dict(taught))
        assert counted.duration_s == pytest.approx(episode.duration_s, abs=1e-6)
        assert counted.started_at_s == pytest.approx(episode.started_at_s, abs=1e-3)
        assert [(i, episode.frame(i).data) for i in episode.frames] == pictures[: counted.frames]
        learn_again(make_policy("published-8"), [(episode, Notes())])
    else:
        assert path.stat().st_size < 400
        with pytest.raises(RecordingError):
            open_episode(path)

    if seed % 5 == 0:
        path.write_bytes(path.read_bytes() + bytes(3000))  # a power cut may leave such a file
    ended = end_recording(path)
    assert ended or not counted.is_readable or seed % 5 == 0  # zeros may look like a chunk's end
    if ended:
        opened = open_episode(path)
        assert messages(path) == held
        assert sorted(by_library(path), key=repr) == sorted(held, key=repr)
        assert read_metadata(path).keys() == {RUN, SUMMARY}
        kept = replace(counted, bytes=path.stat().st_size, damage=opened.damage)
        assert read_summary(path) == kept
        assert opened.damage in ("the file was cut short", None)
        assert opened.damage or opened.model_after() is not None
        assert all(opened.frame(frame_id).data for frame_id in list(opened.frames)[::20])
        assert not end_recording(path)


@pytest.mark.parametrize("seed", seeds(20, 300))
def test_any_damage_is_described_and_no_readable_message_is_lost(
    path: Path, whole: bytes, true: set[tuple[int, bytes]], seed: int
) -> None:
    """A file with any other damage than a truncation is left as it is."""
    rng, data = random.Random(seed), bytearray(whole)
    if seed % 2:
        del data[len(data) - 2000 :]
    if seed % 5 == 1:  # damage at the end: the footer, and the records before it
        for _ in range(rng.randrange(1, 20)):
            data[-rng.randrange(1, 1200)] = rng.randrange(256)
    elif seed % 5 == 2:
        data[-28 : -28 + 8] = rng.choice([0, 1, len(data), 2**63, 2**64 - 1]).to_bytes(8, "little")
    elif seed % 5 == 3:
        data = bytearray(rng.randbytes(rng.randrange(0, 200)))
    else:  # damage anywhere
        for _ in range(rng.randrange(1, 8)):
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    path.write_bytes(data)
    summary = read_summary(path)
    assert summary.id == path.stem and summary.bytes == len(data) and summary.frames <= 132
    held, is_only_cut = None, True
    with suppress(RobotError):
        read_metadata(path)
    with suppress(RobotError):
        episode = open_episode(path)
        for frame_id in list(episode.frames)[::20]:
            episode.frame(frame_id)
    with suppress(RobotError):
        held = messages(path)
        cuts = [record for record in scan(path) if isinstance(record, Cut)]
        is_only_cut = all(cut.lost_bytes is not None for cut in cuts)
    if end_recording(path):
        assert is_only_cut
    else:
        assert path.read_bytes() == data
    if held is not None:
        assert messages(path) == held and {message[1:] for message in held} <= true


def test_the_next_start_completes_a_cut_recording(path: Path, whole: bytes) -> None:
    path.write_bytes(whole[: len(whole) // 2])
    path.with_name("other.mcap").write_bytes(b"no recording")
    robot = RecordedBench(path.parent)
    robot.stand(2)
    robot.finish()
    assert read_metadata(path).keys() == {RUN, SUMMARY}
    assert read_summary(path).damage == "the file was cut short"
    assert path.with_name("other.mcap").read_bytes() == b"no recording"


# Malicious ---------------------------------------------------------------------------------------

MAGIC = b"\x89MCAP0\r\n"
TAUGHT = b'{"event": "taught", "frame": 1, "label": "left", "intervention": false, "at_s": 0'
OURS = {RUN: {"format": "1", "origin_ns": "0"}}


@pytest.fixture
def _little_memory() -> Iterator[None]:
    """Limit the memory, so that code that trusts an absurd length fails."""
    resource = pytest.importorskip("resource", reason="only Linux can limit the memory")
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + 600 * 2**20, hard))
    yield
    resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


little_memory = pytest.mark.usefixtures("_little_memory")


def record(opcode: int, body: bytes, length: int | None = None) -> bytes:
    return struct.pack("<BQ", opcode, len(body) if length is None else length) + body


def text(value: bytes, length: int | None = None) -> bytes:
    return struct.pack("<I", len(value) if length is None else length) + value


def chunk(data: bytes, claims: int, compression: bytes = b"zstd", crc: int = 0) -> bytes:
    head = struct.pack("<QQQI", 0, 0, claims, crc)
    return record(6, head + text(compression) + struct.pack("<Q", len(data)) + data)


def is_damaged(path: Path, record: bytes) -> str:
    """Replace the first chunk of a real recording by this record; return the reported damage."""
    data = record_drive(path.parent / "real", frames=5).path.read_bytes()
    at = len(MAGIC)
    while data[at] != 6:
        at += 9 + struct.unpack_from("<Q", data, at + 1)[0]
    path.write_bytes(data[:at] + record)
    assert read_summary(path).damage
    return str(open_episode(path).damage or "")


@little_memory
@crossed(length=[2**63, 2**40, 2**32, 300 * 2**20], opcode=[1, 3, 4, 5, 6, 9, 12, 0x7F])
def test_absurd_lengths_end_the_reading(path: Path, opcode: int, length: int) -> None:
    assert is_damaged(path, record(opcode, b"\0" * 64, length))
    inside = b"\x01\0" + text(b"x", 2**32 - 1) * 4 + b"\0" * 64
    assert opcode in (5, 6, 0x7F) or is_damaged(path, record(opcode, inside))


@little_memory
def test_a_chunk_is_bounded_by_its_own_length_and_by_what_it_may_unpack_to(path: Path) -> None:
    inside, small = record(5, b"\0" * 30, 2**60), zstandard.compress(bytes(200 * 2**20))
    assert is_damaged(path, chunk(inside, len(inside), b""))
    assert len(small) < 2**16
    for claims in (2**62, 200 * 2**20):
        assert "unpacked bytes is too large" in is_damaged(path, chunk(small, claims))
    assert "unpacked size differs" in is_damaged(path, chunk(small, 1000))


def test_a_footer_that_points_elsewhere_is_not_followed(path: Path, whole: bytes) -> None:
    for start in (0, 7, len(whole) - 5, 2**63, 2**40):
        path.write_bytes(whole[:-28] + struct.pack("<QQI", start, 0, 0) + MAGIC)
        assert read_summary(path).frames > 50


@pytest.mark.parametrize("data", [b"", b"\x89MCAP", b"PK\x03\x04" + b"\0" * 99, MAGIC, MAGIC * 9])
def test_a_file_that_is_not_a_recording_is_refused_with_a_reason(path: Path, data: bytes) -> None:
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
    """Write a file with the library itself; a channel is a topic, an encoding and a schema."""
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


def test_a_recording_of_another_program_is_refused(path: Path) -> None:
    with pytest.raises(RecordingError, match="not a recording of this program"):
        open_episode(crafted(path, {}, messages=[b"{}"]))


@little_memory
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
def test_invalid_texts_end_the_reading(path: Path, words: bytes) -> None:
    assert open_episode(crafted(path, OURS, ("/lesson", "json", "x"), [words])).damage


def test_an_invalid_picture_is_reported(path: Path) -> None:
    pictures = (b"\xff" * 40, b"\x32\xff\xff\xff\xff\x0f", b"", b"\x0a\x05")
    channel = ("/camera", "protobuf", "foxglove.RawImage")
    episode = open_episode(crafted(path, OURS, channel, pictures))
    for frame_id in range(4):
        with pytest.raises(RecordingError, match="damaged"):
            episode.frame(frame_id)


@pytest.mark.parametrize("began", ["1e300", "-1e300", "nan", "inf", "yesterday"])
def test_a_time_that_no_list_can_show_is_refused(path: Path, began: str) -> None:
    summary = {"duration_s": "1", "frames": "1", "taught": "{}"}
    metadata = {RUN: OURS[RUN] | {"started_at_s": began}, SUMMARY: summary}
    found = read_summary(crafted(path, metadata))
    assert (found.is_readable, found.started_at_s) == (False, 0.0)
    with pytest.raises(RecordingError, match=r"x\.mcap"):
        open_episode(path)
