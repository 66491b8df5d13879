"""LeRobot datasets of both versions, intact and damaged, teach nothing wrong."""

from __future__ import annotations

import json
import math
import random
import shutil
import stat
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from robot.errors import RecordingError
from robot.exchange.drive import ImportReport, write_episode
from robot.exchange.film import FilmReader, to_jpeg, write_film
from robot.exchange.lerobot import write_lerobot
from robot.exchange.reading import Reading
from robot.exchange.sources import find_drives, unpacked
from robot.policy.image import to_rgb
from robot.recordings.edits import Edit, Notes
from robot.recordings.episode import Episode, open_episode
from robot.types import Action
from tests.kit.sizes import size

from .imported import taught_labels
from .sim_drive import drive_in_simulator

DATASETS = size("TUBS", 12, 500)
CAMERA = "observation.images.front"
ANGLES = {-0.7: Action.LEFT, 0.0: Action.FORWARD, 0.6: Action.RIGHT}
_BLOCK_PX, _BITS = 16, 8


def drawn(number: int) -> np.ndarray[Any, Any]:
    """A picture that shows its number so coarsely that a film preserves it."""
    bits = [255 * (number >> bit & 1) for bit in range(_BITS)]
    row = np.repeat(np.array(bits, np.uint8), _BLOCK_PX)
    return np.repeat(np.tile(row, (2 * _BLOCK_PX, 1))[:, :, None], 3, axis=2)


def number_in(pixels: np.ndarray[Any, Any]) -> int:
    blocks = pixels[:, :, 1].reshape(pixels.shape[0], _BITS, _BLOCK_PX).mean(axis=(0, 2))
    return sum(1 << bit for bit in range(_BITS) if blocks[bit] > 127)


@dataclass
class Dataset:
    """A dataset before it is written, and its true content: the label of each number."""

    dice: random.Random
    is_v3: bool
    has_films: bool
    episodes: list[list[dict[str, Any]]] = field(default_factory=list)
    truth: dict[int, Action | None] = field(default_factory=dict)
    features: dict[str, Any] = field(default_factory=dict)
    info: dict[str, Any] = field(default_factory=dict)

    def write(self, folder: Path) -> None:
        """Write data, films and descriptions: a file for each episode (v2), or one for all (v3)."""
        listed, files, at = [], list[list[dict[str, Any]]](), 0
        for index, frames in enumerate(self.episodes):
            row = {"episode_index": index, "length": len(frames), "tasks": ["drive"]}
            if self.is_v3:
                row |= {"data/chunk_index": 0, "data/file_index": 0}
                row |= {f"videos/{CAMERA}/{n}_index": 0 for n in ("chunk", "file")}
                row |= {f"videos/{CAMERA}/from_timestamp": at / 10}
            listed.append(row)
            at += len(frames)
            if self.is_v3 and files:
                files[0] += frames
            else:
                files.append(list(frames))
        name = "file-{:03d}" if self.is_v3 else "episode_{:06d}"
        for index, frames in enumerate(files):
            pictures = [drawn(frame["number"]) for frame in frames]
            plain = [{k: v for k, v in frame.items() if k != "number"} for frame in frames]
            if self.has_films:
                place = f"{CAMERA}/chunk-000" if self.is_v3 else f"chunk-000/{CAMERA}"
                path = folder / "videos" / place / f"{name.format(index)}.mp4"
                path.parent.mkdir(parents=True, exist_ok=True)
                write_film(pictures, path, 10, key_every=2)
            else:
                for row, picture in zip(plain, pictures, strict=True):
                    row[CAMERA] = {"bytes": to_jpeg(picture).data, "path": None}
            write_rows(plain, folder / "data/chunk-000" / f"{name.format(index)}.parquet")
        (folder / "meta").mkdir()
        (folder / "meta/info.json").write_text(json.dumps(self.info))
        if self.is_v3:
            write_rows(listed, folder / "meta/episodes/chunk-000/file-000.parquet")
        else:
            lines = "".join(json.dumps(row) + "\n" for row in listed)
            (folder / "meta/episodes.jsonl").write_text(lines)


def write_rows(rows: list[dict[str, Any]], path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.Table.from_pylist(rows), path)


def whole(dice: random.Random, *, is_v3: bool, has_films: bool) -> Dataset:
    made = Dataset(dice, is_v3, has_films)
    for index in range(dice.randint(1, 3)):
        frames = []
        for n in range(dice.randint(4, 12)):
            angle, number = dice.choice(list(ANGLES)), len(made.truth)
            made.truth[number] = ANGLES[angle]
            frame = {"number": number, "action": [angle, 0.5], "timestamp": n / 10}
            frames.append({**frame, "frame_index": n, "episode_index": index})
        made.episodes.append(frames)
    shape = [2 * _BLOCK_PX, _BITS * _BLOCK_PX, 3]
    kind = "video" if has_films else "image"
    made.features = {
        "action": {"dtype": "float32", "shape": [2], "names": ["steering", "throttle"]},
        CAMERA: {"dtype": kind, "shape": shape, "names": ["height", "width", "channels"]},
    }
    place = "chunk-{chunk_index:03d}" if is_v3 else "chunk-{episode_chunk:03d}"
    name = "file-{file_index:03d}" if is_v3 else "episode_{episode_index:06d}"
    films = f"{{video_key}}/{place}" if is_v3 else f"{place}/{{video_key}}"
    made.info = {
        "codebase_version": "v3.0" if is_v3 else "v2.1",
        "fps": 10,
        "features": made.features,
        "data_path": f"data/{place}/{name}.parquet",
        "video_path": f"videos/{films}/{name}.mp4" if has_films else None,
        "chunks_size": 1000,
    }
    return made


def any_frame(made: Dataset) -> dict[str, Any]:
    return made.dice.choice(made.dice.choice(made.episodes))


def spoil_action(made: Dataset) -> None:
    """An action that is not a number, out of range, of another length, or missing."""
    frame = any_frame(made)
    frame["action"] = made.dice.choice(
        [[math.nan, 0.5], [7.0, 0.5], [0.5], [], None, [-0.9, math.inf], [None, 0.5]]
    )
    made.truth.pop(frame["number"], None)


def lose_time(made: Dataset) -> None:
    """A lost time is computed from the frame's number."""
    any_frame(made)["timestamp"] = made.dice.choice([None, math.nan, -3.0])


def let_the_policy_drive(made: Dataset) -> None:
    """Some frames were driven by the policy, so they are not examples."""
    for frames in made.episodes:
        for frame in frames:
            is_pilots = made.dice.random() < 0.5
            frame["complementary_info.is_intervention"] = [float(is_pilots)]
            if not is_pilots and frame["number"] in made.truth:
                made.truth[frame["number"]] = None
    made.features["complementary_info.is_intervention"] = {"dtype": "bool", "shape": [1]}


def name_an_arm(made: Dataset) -> None:
    """The elements of the action are joints, so none of them is steering."""
    made.features["action"]["names"] = {"motors": ["shoulder_pan.pos", "gripper.pos"]}
    made.truth = dict.fromkeys(made.truth)


BEFORE = [spoil_action, lose_time, let_the_policy_drive, name_an_arm]


def cut(path: Path, dice: random.Random) -> None:
    data = path.read_bytes()
    path.write_bytes(data[: dice.randint(0, len(data) - 9)])


def lose_a_film(folder: Path, made: Dataset) -> None:
    found = sorted(folder.glob("videos/**/*.mp4"))
    if found:
        index = made.dice.randrange(len(found))
        dice = made.dice
        dice.choice([Path.unlink, lambda path: cut(path, dice)])(found[index])
        forget(made, None if made.is_v3 else index)


def lose_data(folder: Path, made: Dataset) -> None:
    found = sorted(folder.glob("data/**/*.parquet"))
    index = made.dice.randrange(len(found))
    cut(found[index], made.dice)
    forget(made, None if made.is_v3 else index)


def lose_the_list(folder: Path, made: Dataset) -> None:
    if made.is_v3:
        cut(folder / "meta/episodes/chunk-000/file-000.parquet", made.dice)
        if made.has_films:
            forget(made, None)  # their beginning in the film is unknown
    else:
        cut(folder / "meta/episodes.jsonl", made.dice)


def lead_out(folder: Path, made: Dataset) -> None:
    """Tables are found at the place that the description names; a film is not."""
    paths = ["../../etc/passwd", "/etc/passwd", "{episode_index.__class__}", "\0", ""]
    made.info[made.dice.choice(["data_path", "video_path"])] = made.dice.choice(paths)
    (folder / "meta/info.json").write_text(json.dumps(made.info))
    if made.has_films and made.info["video_path"] in paths:
        forget(made, None)


def describe_what_is_not_there(folder: Path, made: Dataset) -> None:
    """If the tables lack the column of pilots, nothing is taught, and the pictures stay."""
    made.features["pilot"] = {"info": made.dice.choice(["none", {"moves": ["left"]}])}
    (folder / "meta/info.json").write_text(json.dumps(made.info))
    forget(made, None)


def describe_nothing(folder: Path, made: Dataset) -> None:
    text = made.dice.choice(["", "[]", "{", '{"fps": 0}', "[" * 9999, '{"codebase_version": "v9"}'])
    (folder / "meta/info.json").write_text(text)
    forget(made, None)


AFTER = [lose_a_film, lose_data, lose_the_list, lead_out]
AFTER += [describe_what_is_not_there, describe_nothing]


def forget(made: Dataset, episode: int | None) -> None:
    for index, frames in enumerate(made.episodes):
        if episode in (None, index):
            for frame in frames:
                made.truth.pop(frame["number"], None)


def imported(folder: Path, scratch: Path) -> Iterator[tuple[Episode, ImportReport]]:
    try:
        sources = find_drives(folder)
    except RecordingError as error:
        assert "damaged" in str(error) or "not v2 or v3" in str(error)
        return
    for source in sources:
        report, path = ImportReport(), scratch / f"{source.name.split()[-1]}.mcap"
        try:
            write_episode(source.read(Reading(), report), path)
        except RecordingError as error:
            assert not path.exists() and str(error)
        else:
            yield open_episode(path), report


def test_damaged_datasets_keep_what_is_whole_and_teach_nothing_wrong(tmp_path: Path) -> None:
    total = kept = wrong = 0
    for seed in range(DATASETS):
        dice = random.Random(seed)
        made = whole(dice, is_v3=dice.random() < 0.5, has_films=dice.random() < 0.6)
        damages: list[Callable[..., None]] = dice.sample(BEFORE, dice.randint(0, 2))
        for damage in damages:
            damage(made)
        root, scratch = tmp_path / f"set{seed}", tmp_path / f"got{seed}"
        scratch.mkdir()
        made.write(root)
        if dice.random() < 0.5:
            dice.choice(AFTER)(root, made)
        found: dict[int, Action | None] = {}
        for episode, _ in imported(root, scratch):
            labels = taught_labels(episode)
            for frame_id in episode.frames:
                found[number_in(to_rgb(episode.frame(frame_id)))] = labels.get(frame_id)
        total += len(made.truth)
        kept += len(found.keys() & made.truth.keys())
        for number, label in found.items():
            wrong += number in made.truth and label != made.truth[number]
            wrong += number not in made.truth and label not in (None, *ANGLES.values())
        shutil.rmtree(root)
        shutil.rmtree(scratch)
    print(f"{DATASETS} datasets: {kept} of {total} whole frames kept, {wrong} wrong labels")
    assert total > 3 * DATASETS and kept >= 0.99 * total and wrong == 0


@pytest.fixture(scope="module")
def episode(tmp_path_factory: pytest.TempPathFactory) -> Episode:
    return open_episode(drive_in_simulator(tmp_path_factory.mktemp("sim"), "default-8").path)


def corrections(one: Episode) -> int:
    return sum(event.example.is_intervention for _, event in one.events)  # type: ignore[union-attr]


def test_an_export_comes_back_with_its_labels_and_corrections(
    episode: Episode, tmp_path: Path
) -> None:
    ids, given = list(episode.frames), taught_labels(episode)
    backward = Edit(verb="relabel", ranges=((ids[20], ids[29]),), label=Action.BACKWARD)
    write_lerobot([(episode, Notes(edits=(backward,)))], tmp_path / "set")
    [(back, report)] = imported(tmp_path / "set", tmp_path)
    wanted = [given.get(frame_id) for frame_id in ids]
    wanted[20:30] = [Action.BACKWARD] * 10
    got = taught_labels(back)
    assert [got.get(frame_id) for frame_id in back.frames] == wanted and None in wanted
    assert report.skipped == [] and "the pilot did not drive" in report.lines()[0]
    assert corrections(back) == corrections(episode) > 0


def test_a_cache_of_links_is_read_and_links_that_are_not_followed_are_said(
    episode: Episode, tmp_path: Path
) -> None:
    """A download by Hugging Face: every file is a link into `blobs`."""
    whole_set, cache = tmp_path / "set", tmp_path / "datasets--me--drive"
    write_lerobot([(episode, Notes())], whole_set)
    (cache / "blobs").mkdir(parents=True)
    for number, path in enumerate(p for p in sorted(whole_set.rglob("*")) if p.is_file()):
        link = cache / "snapshots/0a1b2c" / path.relative_to(whole_set)
        link.parent.mkdir(parents=True, exist_ok=True)
        path.rename(cache / f"blobs/{number}")
        link.symlink_to(cache / f"blobs/{number}")
    [(back, report)] = imported(cache / "snapshots/0a1b2c", tmp_path)
    assert report.skipped == []
    assert list(taught_labels(back).values()) == list(taught_labels(episode).values())

    shutil.make_archive(str(tmp_path / "packed"), "tar", cache)
    with zipfile.ZipFile(tmp_path / "packed.zip", "w") as archive:
        link = zipfile.ZipInfo("meta/info.json")
        link.external_attr = (stat.S_IFLNK | 0o777) << 16
        archive.writestr(link, "../../blobs/1")
    for ending in ("tar", "zip"):
        told = ImportReport()
        with unpacked(tmp_path / f"packed.{ending}", tmp_path, told) as folder:
            assert not any(folder.rglob("info.json"))
        assert "the entry is a link: pack the files themselves" in told.why_nothing()
    (tmp_path / "drives").mkdir()
    (tmp_path / "drives/one").symlink_to(cache / "snapshots/0a1b2c")
    with pytest.raises(RecordingError, match="links to folders are not followed"):
        find_drives(tmp_path / "drives")


def test_with_the_option_strict_nothing_is_imported_if_pictures_would_be_skipped(
    tmp_path: Path,
) -> None:
    made = whole(random.Random(1), is_v3=True, has_films=True)
    any_frame(made)["action"] = [math.nan, 0.0]
    made.write(tmp_path / "set")
    with pytest.raises(RecordingError, match="the angle is 'nan'"):
        for source in find_drives(tmp_path / "set"):
            source.read(Reading(), ImportReport(is_strict=True))


def test_a_dataset_of_an_arm_says_why_it_teaches_nothing(tmp_path: Path) -> None:
    made = whole(random.Random(2), is_v3=False, has_films=False)
    name_an_arm(made)
    made.write(tmp_path / "set")
    [(_, report), *_] = imported(tmp_path / "set", tmp_path)
    assert "neither steering nor moves (shoulder_pan, gripper)" in report.lines()[1]


def test_steering_in_degrees_is_refused_instead_of_teaching_only_straights(tmp_path: Path) -> None:
    made = whole(random.Random(3), is_v3=True, has_films=False)
    for frames in made.episodes:
        for frame in frames:
            frame["action"][0] *= 90
    made.write(tmp_path / "set")
    source = find_drives(tmp_path / "set")[0]
    with pytest.raises(RecordingError, match=r"'steering' goes from .*, not from -1 to 1"):
        source.read(Reading(), ImportReport())
    drive = source.read(Reading(full_lock=90), ImportReport())
    labels = [made.truth[frame["number"]] for frame in made.episodes[0]]
    assert [shot.label for shot in drive.shots] == labels


def test_the_last_episode_of_a_film_is_read_from_where_it_begins(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, decoded = tmp_path / "film.mp4", 0
    write_film([drawn(n) for n in range(200)], path, 10, key_every=10)
    decode = FilmReader._decode

    def counted(reader: FilmReader, from_s: float) -> Iterator[Any]:
        nonlocal decoded
        for frame in decode(reader, from_s):
            decoded += 1
            yield frame

    monkeypatch.setattr(FilmReader, "_decode", counted)
    for number in (0, 195, 37):
        shown = FilmReader(path, 10).at(number / 10)
        pixels = cv2.imdecode(np.frombuffer(shown.data, np.uint8), cv2.IMREAD_COLOR)
        assert number_in(pixels) == number
    assert decoded <= 30
