"""LeRobot datasets of both versions are written and read, and damaged ones teach nothing wrong.

LeRobot itself reads, edits and merges exports in tests/conformance.
"""

from __future__ import annotations

import json
import math
import shutil
import stat
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any

import av
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from robot.errors import RecordingError
from robot.exchange.drive import ImportReport, write_episode
from robot.exchange.film import write_film
from robot.exchange.lerobot import CAMERA, write_lerobot
from robot.exchange.reading import Reading
from robot.exchange.sources import find_drives, unpacked
from robot.policy.image import to_rgb
from robot.recordings.edits import Edit, Notes
from robot.recordings.episode import Episode, open_episode, taught_frames
from robot.types import Action

from .imported import drive_at, labels_by_number, picture, pixels, taught_labels

FILM = f"videos/{CAMERA}/chunk-000/file-000.mp4"
L, F, R = Action.LEFT, Action.FORWARD, Action.RIGHT
Labels = dict[int, Action | None]


@pytest.fixture(scope="module")
def exported(episode: Episode, tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("sets") / "dataset"
    assert write_lerobot([(episode, Notes())], root) == 1
    return root


def read_info(root: Path) -> dict[str, Any]:
    return dict(json.loads((root / "meta/info.json").read_text()))


def test_an_export_has_the_published_layout(exported: Path) -> None:
    info = read_info(exported)
    assert info["codebase_version"] == "v3.0" and info["fps"] == 20
    data = pq.read_table(exported / info["data_path"].format(chunk_index=0, file_index=0))
    assert data.num_rows == info["total_frames"]
    stamps = data["timestamp"].to_numpy()
    assert np.array_equal(stamps, (np.arange(len(stamps)) / 20).astype(np.float32))
    [row] = pq.read_table(exported / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert row["length"] == len(stamps) and row["tasks"] == ["Drive as the pilot taught."]
    assert row[f"videos/{CAMERA}/to_timestamp"] == pytest.approx(len(stamps) / 20)
    tasks = pq.read_table(exported / "meta/tasks.parquet")
    assert json.loads(tasks.schema.metadata[b"pandas"])["index_columns"] == ["task"]


def test_a_datasets_film_shows_the_pictures_frame_by_frame_and_its_statistics_are_true(
    episode: Episode, exported: Path
) -> None:
    with av.open(str(exported / FILM)) as film:
        decoded = list(film.decode(video=0))
    shown, ids = [frame.to_ndarray(format="rgb24") for frame in decoded], list(episode.frames)
    keys = [number for number, frame in enumerate(decoded) if frame.key_frame]
    assert len(shown) == len(ids)
    assert keys[:3] == [0, 2, 4], "a loader has to decode two frames at most"
    for index in (0, len(ids) // 2, len(ids) - 1):
        given = to_rgb(episode.frame(ids[index])).astype(float)
        assert np.abs(shown[index] - given).mean() < 12
    actions = pq.read_table(exported / "data/chunk-000/file-000.parquet")["action"].to_pylist()
    stats = json.loads((exported / "meta/stats.json").read_text())
    assert set(stats) == set(read_info(exported)["features"])
    for kind, share in (("q01", 0.01), ("q50", 0.5), ("q99", 0.99)):
        of_film = np.quantile(np.stack(shown) / 255, share, axis=(0, 1, 2))
        assert np.abs(np.ravel(stats[CAMERA][kind]) - of_film).max() < 0.06
        assert stats["action"][kind] == np.quantile(actions, share, axis=0).tolist()


def corrections(one: Episode) -> int:
    return sum(event.example.is_intervention for _, event in one.events)


def test_actions_say_what_was_done_and_what_was_corrected(episode: Episode, exported: Path) -> None:
    data = pq.read_table(exported / "data/chunk-000/file-000.parquet").to_pydict()
    for name in ("action", "observation.state"):
        assert set(map(tuple, data[name])) <= {(0.0, 0.5), (-1.0, 0.5), (0.0, 0.0)}
    assert sum(data["intervention"]) == corrections(episode) == len(taught_frames(episode)) - 59
    sensors = np.array(data["sensors"])
    assert sensors.shape[1] == 3 and 0 < sensors[:, 0].mean() < 2.55


def test_deleted_ranges_split_a_dataset(episode: Episode, tmp_path: Path) -> None:
    ids = list(episode.frames)
    notes = Notes(edits=(Edit(verb="delete", ranges=((ids[40], ids[80]),)),))
    assert write_lerobot([(episode, notes)], tmp_path / "dataset") == 2
    rows = pq.read_table(tmp_path / "dataset/meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [row["length"] for row in rows] == [40, len(ids) - 81]
    assert rows[1]["dataset_from_index"] == rows[0]["dataset_to_index"] == 40


def imported(folder: Path, **reading: Any) -> Iterator[tuple[Episode, ImportReport]]:
    """Import each episode of a dataset that can be imported."""
    for number, source in enumerate(find_drives(folder)):
        report, path = ImportReport(), folder.with_name(f"{folder.name} {number}.mcap")
        try:
            write_episode(source.read(Reading(**reading), report), path)
        except RecordingError:
            assert not path.exists()
        else:
            yield open_episode(path), report


def labels_in(folder: Path, **reading: Any) -> Labels:
    """Return the label of each picture that can be imported, by its number."""
    found: Labels = {}
    for episode, _ in imported(folder, **reading):
        found |= labels_by_number(episode)
    return found


def test_a_plain_export_has_only_taught_frames_and_can_be_imported(
    episode: Episode, tmp_path: Path
) -> None:
    """The dataset has the features that LeRobot records from the robot."""
    write_lerobot([(episode, Notes())], tmp_path / "plain", plain=True)
    info = read_info(tmp_path / "plain")
    own = {"timestamp", "frame_index", "episode_index", "index", "task_index"}
    assert set(info["features"]) - own == {CAMERA, "action", "observation.state"}
    assert info["features"]["action"]["names"] == ["steering.pos", "throttle.vel"]
    back = [one for one, _ in imported(tmp_path / "plain")]
    frames = sum(len(one.frames) for one in back)
    assert frames == sum(len(taught_frames(one)) for one in back) == info["total_frames"]
    assert frames >= len(taught_frames(episode))


def test_an_export_comes_back_with_its_labels_and_corrections(
    episode: Episode, tmp_path: Path
) -> None:
    ids, given = list(episode.frames), taught_labels(episode)
    backward = Edit(verb="relabel", ranges=((ids[20], ids[29]),), label=Action.BACKWARD)
    write_lerobot([(episode, Notes(edits=(backward,)))], tmp_path / "set")
    [(back, report)] = imported(tmp_path / "set")
    wanted = [given.get(frame_id) for frame_id in ids]
    wanted[20:30] = [Action.BACKWARD] * 10
    got = taught_labels(back)
    assert [got.get(frame_id) for frame_id in back.frames] == wanted and None in wanted
    assert report.skipped == [] and "the pilot did not drive" in report.lines()[0]
    assert corrections(back) == corrections(episode) > 0


def test_a_cache_of_links_is_read_and_links_that_are_not_followed_are_said(
    exported: Path, episode: Episode, tmp_path: Path
) -> None:
    """A download by Hugging Face: every file is a link into `blobs`."""
    cache = tmp_path / "datasets--me--drive"
    (cache / "blobs").mkdir(parents=True)
    for number, path in enumerate(p for p in sorted(exported.rglob("*")) if p.is_file()):
        link = cache / "snapshots/0a1b2c" / path.relative_to(exported)
        link.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, cache / f"blobs/{number}")
        link.symlink_to(cache / f"blobs/{number}")
    [(back, report)] = imported(cache / "snapshots/0a1b2c")
    assert report.skipped == []
    assert list(taught_labels(back).values()) == list(taught_labels(episode).values())

    shutil.make_archive(str(tmp_path / "packed"), "tar", cache)
    with zipfile.ZipFile(tmp_path / "packed.zip", "w") as archive:
        info = zipfile.ZipInfo("meta/info.json")
        info.external_attr = (stat.S_IFLNK | 0o777) << 16
        archive.writestr(info, "../../blobs/1")
    for ending in ("tar", "zip"):
        told = ImportReport()
        with unpacked(tmp_path / f"packed.{ending}", tmp_path, told) as folder:
            assert not any(folder.rglob("info.json"))
        assert "the entry is a link: pack the file instead" in told.why_nothing()
    (tmp_path / "drives").mkdir()
    (tmp_path / "drives/one").symlink_to(cache / "snapshots/0a1b2c")
    with pytest.raises(RecordingError, match="links to folders are not followed"):
        find_drives(tmp_path / "drives")


# Third-party and damaged datasets ------------------------------------------------------------

TRUTH: Labels = dict(enumerate([L, F, R, L, F, R, L, F], 1))


@dataclass
class Dataset:
    """Two episodes of four frames each, whose pictures are numbered from 1. TRUTH has the labels of
    the pictures."""

    is_v3: bool = True
    has_films: bool = False
    names: Any = ("steering", "throttle")
    rows: list[dict[str, Any]] = field(default_factory=list)
    features: dict[str, Any] = field(default_factory=dict)
    info: dict[str, Any] = field(default_factory=dict)
    """Changes of the description."""

    def __post_init__(self) -> None:
        for number, label in TRUTH.items():
            row = {"number": number, "action": [{L: -0.7, F: 0.0, R: 0.6}[label or F], 0.5]}
            index, episode = (number - 1) % 4, (number - 1) // 4
            row |= {"timestamp": index / 10, "frame_index": index, "episode_index": episode}
            self.rows.append(row)

    def write(self, folder: Path) -> Path:
        """Write data, films and descriptions: a file for each episode (v2), or one for all (v3)."""
        episodes = [[row for row in self.rows if row["episode_index"] == n] for n in (0, 1)]
        films = f"videos/{CAMERA}/chunk-000" if self.is_v3 else f"videos/chunk-000/{CAMERA}"
        for n, rows in enumerate([self.rows] if self.is_v3 else episodes):
            name = "file-000" if self.is_v3 else f"episode_00000{n}"
            if self.has_films:
                (folder / films).mkdir(parents=True, exist_ok=True)
                shown = [pixels(row["number"]) for row in rows]
                write_film(shown, folder / films / f"{name}.mp4", 10, key_every=2)
            else:
                rows = [{**r, CAMERA: {"bytes": picture(r["number"]), "path": None}} for r in rows]
            write_rows(rows, folder / f"data/chunk-000/{name}.parquet")
        (folder / "meta").mkdir()
        listed: list[dict[str, Any]] = [{"episode_index": n, "length": 4} for n in (0, 1)]
        if self.is_v3:
            place = dict.fromkeys((f"videos/{CAMERA}/{n}_index" for n in ("chunk", "file")), 0)
            starts = [{f"videos/{CAMERA}/from_timestamp": n * 4 / 10} for n in (0, 1)]
            listed = [{**row, **place, **start} for row, start in zip(listed, starts, strict=True)]
            write_rows(listed, folder / "meta/episodes/chunk-000/file-000.parquet")
        else:
            lines = "".join(json.dumps(row) + "\n" for row in listed)
            (folder / "meta/episodes.jsonl").write_text(lines)
        shape = {"shape": [120, 160, 3], "names": ["height", "width", "channels"]}
        action = {"dtype": "float32", "shape": [2], "names": self.names}
        kind = "video" if self.has_films else "image"
        info = {
            "codebase_version": "v3.0" if self.is_v3 else "v2.1",
            "fps": 10,
            "features": {**self.features, "action": action, CAMERA: {"dtype": kind, **shape}},
            "video_path": "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
            if self.is_v3
            else "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4",
        }
        (folder / "meta/info.json").write_text(json.dumps({**info, **self.info}))
        return folder


def write_rows(rows: list[dict[str, Any]], path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.Table.from_pylist(rows), path)


BAD_ACTIONS = ([math.nan, 0.5], [7.0, 0.5], [0.5], [], None, [-0.9, math.inf], [None, 0.5])


def spoil_actions(made: Dataset) -> Labels:
    """Actions that are not numbers, out of range, of another length, or missing."""
    for row, bad in zip(made.rows, BAD_ACTIONS, strict=False):
        row["action"] = bad
    return {8: F}


def lose_times(made: Dataset) -> Labels:
    """A lost time is computed from the frame's number."""
    for row, bad in zip(made.rows, (None, math.nan, -3.0), strict=False):
        row["timestamp"] = bad
    return TRUTH


def let_the_policy_drive(made: Dataset) -> Labels:
    """Frames that the policy drove are not examples."""
    name = "complementary_info.is_intervention"
    made.features[name] = {"dtype": "bool", "shape": [1]}
    for row in made.rows:
        row[name] = [float(row["number"] % 2)]
    return {number: label if number % 2 else None for number, label in TRUTH.items()}


def name_an_arm(made: Dataset) -> Labels:
    """The elements of this dataset's action are joints, so none of them is the steering."""
    made.names = {"motors": ["shoulder_pan.pos", "gripper.pos"]}
    return dict.fromkeys(TRUTH)


def describe_a_pilot_who_is_not_in_the_tables(made: Dataset) -> Labels:
    made.features["pilot"] = {"info": {"moves": ["left"]}}
    return {}


def lead_nowhere(made: Dataset) -> Labels:
    made.info = {"video_path": "{episode_index.__class__}\0"}
    return {} if made.has_films else TRUTH


VARIANTS = list(product((True, False), repeat=2))
"""Each case is tried in version 2 and 3, with films and without."""


@pytest.mark.parametrize(
    "damage",
    [
        *(spoil_actions, lose_times, let_the_policy_drive, name_an_arm, lead_nowhere),
        describe_a_pilot_who_is_not_in_the_tables,
    ],
)
def test_a_damaged_dataset_keeps_what_is_whole_and_teaches_nothing_wrong(
    tmp_path: Path, damage: Callable[[Dataset], Labels]
) -> None:
    for is_v3, has_films in VARIANTS:
        made, case = Dataset(is_v3, has_films), f"v3={is_v3}, films={has_films}"
        wanted = damage(made)
        assert labels_in(made.write(tmp_path / case)) == wanted, case


def test_a_film_outside_of_a_dataset_is_not_read(tmp_path: Path) -> None:
    made = Dataset(has_films=True, info={"video_path": "../film.mp4"})
    [film] = made.write(tmp_path / "set").rglob("*.mp4")
    film.rename(tmp_path / "film.mp4")
    assert labels_in(tmp_path / "set") == {}


@pytest.mark.parametrize("is_cut", [True, False])
def test_a_lost_file_of_a_dataset_costs_only_what_was_in_it(tmp_path: Path, is_cut: bool) -> None:
    for is_v3, has_films in VARIANTS:
        whole = Dataset(is_v3, has_films).write(tmp_path / f"v3={is_v3}, films={has_films}")
        for number, lost in enumerate(path for path in whole.rglob("*") if path.is_file()):
            name = lost.relative_to(whole).as_posix()
            folder = shutil.copytree(whole, tmp_path / f"{whole.name} {number}")
            half = (folder / name).read_bytes()[: lost.stat().st_size // 2]
            (folder / name).unlink()
            if is_cut:
                (folder / name).write_bytes(half)
            try:
                found = labels_in(folder)
            except RecordingError:
                found = {}
            kept: Labels = {}
            if "meta/episodes" in name and not (is_v3 and has_films):
                kept = TRUTH  # the list of episodes is needed only to find them in a film
            elif "episode_" in name:
                kept = {n: TRUTH[n] for n in TRUTH if (n > 4) == ("episode_000000" in name)}
            assert kept.items() <= found.items() <= TRUTH.items(), (whole.name, name)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{",
        '{"fps": 0}',
        "[" * 9999,
        '{"codebase_version": "v9", "fps": 1, "features": {}}',
    ],
)
def test_a_dataset_without_a_valid_description_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "meta").mkdir()
    (tmp_path / "meta/info.json").write_text(text)
    with pytest.raises(RecordingError, match="not v2 or v3" if "v9" in text else "damaged"):
        find_drives(tmp_path)


def test_a_dataset_that_was_never_finalized_is_named_as_such(tmp_path: Path) -> None:
    (tmp_path / "meta").mkdir()
    info = {"codebase_version": "v3.0", "fps": 10, "features": {}}
    (tmp_path / "meta/info.json").write_text(json.dumps(info))
    (tmp_path / "data/0").mkdir(parents=True)
    (tmp_path / "data/0/file-000.parquet").write_bytes(b"PAR1 and no end")
    with pytest.raises(RecordingError, match="never finalized"):
        drive_at(tmp_path)


@pytest.mark.parametrize(
    ("names", "actions"),
    [
        (["linear_velocity", "angular_velocity"], [(1, 0.7), (1, -0.7), (1, 0), (0, 0)]),
        (["linear.x", "angular.z"], [(0.2, 0.7), (0.2, -0.7), (0.2, 0), (0, 0)]),
        (
            ["arm_gripper.pos", "x.vel", "y.vel", "theta.vel"],
            [(50, 0.2, 0, 40), (50, 0.2, 0, -40), (50, 0.2, 0, 0), (50, 0, 0, 0)],
        ),
        ({"throttle": 1, "steering": 0}, [(-0.7, 0.4), (0.7, 0.4), (0, 0.4), (0.7, 0)]),
        (["left", "right", "forward", "stop"], np.eye(4).tolist()),
    ],
    ids=["EarthRover", "ROS", "LeKiwi", "car", "one element for each move"],
)
def test_the_actions_of_other_robots_are_labels(
    tmp_path: Path, names: Any, actions: list[tuple[float, ...]]
) -> None:
    """In these datasets, pilots turn left, turn right, drive on and stand. The import ignores the
    depth camera."""
    depth = {"dtype": "image", "shape": [120, 160, 3], "info": {"is_depth_map": True}}
    made = Dataset(names=names, features={"front_depth": depth})
    made.rows = [
        {**row, "action": list(map(float, action)), "front_depth": {"bytes": picture(12)}}
        for row, action in zip(made.rows, actions, strict=False)
    ]
    assert labels_in(made.write(tmp_path / "set")) == {1: L, 2: R, 3: F, 4: None}


def test_steering_at_the_threshold_is_straight_as_float32_too(tmp_path: Path) -> None:
    made = Dataset(names=["steering.pos", "throttle.vel"])
    made.rows = made.rows[:4]
    for row, steering in zip(made.rows, (0.2, -0.2, 0.21, -0.21), strict=True):
        row["action"] = [np.float32(steering).item(), 0.5]
    assert labels_in(made.write(tmp_path / "set")) == {1: F, 2: F, 3: R, 4: L}


def test_a_dataset_of_an_arm_says_why_it_teaches_nothing(tmp_path: Path) -> None:
    made = Dataset(is_v3=False)
    name_an_arm(made)
    [(_, report), *_] = imported(made.write(tmp_path / "set"))
    assert "neither steering nor moves (shoulder_pan, gripper)" in report.lines()[1]


def test_steering_in_degrees_is_refused_instead_of_teaching_only_straights(tmp_path: Path) -> None:
    made = Dataset()
    for row in made.rows:
        row["action"][0] *= 90
    source = find_drives(made.write(tmp_path / "set"))[0]
    with pytest.raises(RecordingError, match=r"'steering' goes from .*, not from -1 to 1"):
        source.read(Reading(), ImportReport())
    assert labels_in(tmp_path / "set", full_lock=90) == TRUTH
