"""The tools for which an export is meant can read it."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path
from typing import Any

import av
import numpy as np
import pyarrow.parquet as pq
import pytest
from mcap.reader import make_reader

from robot.errors import RecordingError
from robot.exchange.drive import ImportReport, write_episode
from robot.exchange.film import _BAR_PX, _captioned, to_jpeg, write_film, write_look
from robot.exchange.folder import write_folder
from robot.exchange.lerobot import CAMERA, write_lerobot
from robot.exchange.npz import write_npz
from robot.exchange.own import copy_recording
from robot.exchange.reading import Reading
from robot.exchange.sources import find_drives
from robot.exchange.tub import write_tub
from robot.policy.image import to_rgb
from robot.policy.registry import make_policy
from robot.recordings.editing import EpisodeFrame, write_edited
from robot.recordings.edits import Edit, Notes, trim
from robot.recordings.episode import Episode, open_episode, taught_frames
from robot.recordings.teaching import learn_again
from robot.simulator.camera import SimCamera
from robot.store.models.model import same_nodes
from robot.types import Action, Frame, Mode
from tests.kit.protobuf import read_protobuf
from tests.robot.recordings.drives import RecordedBench

from .imported import raw
from .sim_drive import drive_in_simulator

FILM = f"videos/{CAMERA}/chunk-000/file-000.mp4"


@pytest.fixture(scope="module")
def episode(tmp_path_factory: pytest.TempPathFactory) -> Episode:
    return open_episode(drive_in_simulator(tmp_path_factory.mktemp("sim"), "default-8").path)


def decoded(path: Path) -> tuple[list[np.ndarray], list[int]]:
    """Return a film's pictures, and the numbers of its key frames."""
    with av.open(str(path)) as container:
        frames = list(container.decode(video=0))
    pictures = [frame.to_ndarray(format="rgb24") for frame in frames]
    return pictures, [i for i, frame in enumerate(frames) if frame.key_frame]


@pytest.fixture(scope="module")
def dataset(episode: Episode, tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("sets") / "dataset"
    assert write_lerobot([(episode, Notes())], root) == 1
    return root


def read_info(root: Path) -> dict[str, Any]:
    return dict(json.loads((root / "meta/info.json").read_text()))


def test_a_lerobot_dataset_has_the_published_layout(dataset: Path) -> None:
    info = read_info(dataset)
    assert info["codebase_version"] == "v3.0" and info["fps"] == 20
    data = pq.read_table(dataset / info["data_path"].format(chunk_index=0, file_index=0))
    assert data.num_rows == info["total_frames"]
    for name, feature in info["features"].items():
        if feature["dtype"] != "video":
            kind = str(data.schema.field(name).type)
            wide = f"fixed_size_list<element: float>[{feature['shape'][0]}]"
            assert kind in (feature["dtype"], wide, "float")
    stamps = data["timestamp"].to_numpy()
    assert np.array_equal(stamps, (np.arange(len(stamps)) / 20).astype(np.float32))
    assert data["index"].to_pylist() == list(range(len(stamps)))
    [row] = pq.read_table(dataset / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert (row["dataset_from_index"], row["dataset_to_index"]) == (0, len(stamps))
    assert row["length"] == len(stamps) and row["tasks"] == ["Drive as the pilot taught."]
    assert row[f"videos/{CAMERA}/to_timestamp"] == pytest.approx(len(stamps) / 20)
    tasks = pq.read_table(dataset / "meta/tasks.parquet")
    assert json.loads(tasks.schema.metadata[b"pandas"])["index_columns"] == ["task"]
    stats = json.loads((dataset / "meta/stats.json").read_text())
    assert set(stats) == set(info["features"])
    assert np.shape(stats[CAMERA]["mean"]) == (3, 1, 1)
    film = np.stack(decoded(dataset / FILM)[0]) / 255
    actions = data["action"].to_pylist()
    for kind, share in (("q01", 0.01), ("q50", 0.5), ("q99", 0.99)):
        of_film = np.quantile(film, share, axis=(0, 1, 2))
        assert np.abs(np.ravel(stats[CAMERA][kind]) - of_film).max() < 0.06
        assert stats["action"][kind] == np.quantile(actions, share, axis=0).tolist()


def test_its_film_shows_the_pictures_frame_by_frame(episode: Episode, dataset: Path) -> None:
    shown, keys = decoded(dataset / FILM)
    ids = list(episode.frames)
    assert len(shown) == len(ids)
    assert keys[:3] == [0, 2, 4], "a loader decodes two at most"
    for index in (0, len(ids) // 2, len(ids) - 1):
        given = to_rgb(episode.frame(ids[index])).astype(float)
        assert np.abs(shown[index] - given).mean() < 12


def test_actions_say_what_was_done_and_what_was_corrected(episode: Episode, dataset: Path) -> None:
    data = pq.read_table(dataset / "data/chunk-000/file-000.parquet").to_pydict()
    for name in ("action", "observation.state"):
        assert set(map(tuple, data[name])) <= {(0.0, 0.5), (-1.0, 0.5), (0.0, 0.0)}
    corrected = [event.example.is_intervention for _, event in episode.events]  # type: ignore[union-attr]
    assert sum(data["intervention"]) == sum(corrected) == len(taught_frames(episode)) - 99
    sensors = np.array(data["sensors"])
    assert sensors.shape[1] == 3 and 0 < sensors[:, 0].mean() < 2.55


def test_the_features_of_a_dataset_follow_from_the_robot_and_not_from_the_lesson(
    episode: Episode, dataset: Path, tmp_path: Path
) -> None:
    ids = list(episode.frames)
    brief = Notes(edits=(Edit(verb="delete", ranges=((ids[20], ids[-1]),)),))
    write_lerobot([(episode, brief)], tmp_path / "brief")
    infos = [read_info(dataset), read_info(tmp_path / "brief")]
    same = ("fps", "robot_type", "features")
    assert [infos[0][key] for key in same] == [infos[1][key] for key in same]
    assert infos[0]["features"]["pilot"]["info"]["moves"] == ["forward", "left", "right"]
    assert (infos[0]["fps"], infos[0]["robot_type"]) == (20, "drivelesson")


def test_a_plain_dataset_has_what_lerobot_records_of_the_robot_and_only_what_was_taught(
    episode: Episode, tmp_path: Path
) -> None:
    write_lerobot([(episode, Notes())], tmp_path / "plain", plain=True)
    info = read_info(tmp_path / "plain")
    own = {"timestamp", "frame_index", "episode_index", "index", "task_index"}
    assert set(info["features"]) - own == {CAMERA, "action", "observation.state"}
    for name in ("action", "observation.state"):
        assert info["features"][name]["names"] == ["steering.pos", "throttle.vel"]
    frames = examples = 0
    for source in find_drives(tmp_path / "plain"):
        path = tmp_path / f"{source.name}.mcap"
        frames += write_episode(source.read(Reading(), ImportReport()), path)
        examples += len(taught_frames(open_episode(path)))
    assert frames == examples == info["total_frames"] >= len(taught_frames(episode))


def test_a_folder_has_its_labels_where_imagefolder_looks_for_them(
    episode: Episode, tmp_path: Path
) -> None:
    write_folder(episode, Notes(), tmp_path / "folder")
    with (tmp_path / "folder/metadata.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(episode.frames)
    assert all((tmp_path / "folder" / row["file_name"]).is_file() for row in rows)
    taught = [str(example.label) for example in taught_frames(episode).values()]
    assert [row["label"] for row in rows if row["label"]] == taught
    assert len(find_drives(tmp_path / "folder")) == 1


def test_deleted_ranges_split_a_dataset(episode: Episode, tmp_path: Path) -> None:
    ids = list(episode.frames)
    notes = Notes(edits=(Edit(verb="delete", ranges=((ids[60], ids[120]),)),))
    assert write_lerobot([(episode, notes)], tmp_path / "dataset") == 2
    rows = pq.read_table(tmp_path / "dataset/meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [row["length"] for row in rows] == [60, len(ids) - 121]
    assert rows[1]["dataset_from_index"] == rows[0]["dataset_to_index"] == 60


def test_pictures_of_several_sizes_are_all_kept_and_every_reader_takes_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A camera changes its resolution and is turned while it is recorded."""

    def capture(camera: SimCamera) -> Frame:
        picture, number = camera._body.simulation.render(), camera._last_frame_id
        if number >= 140:
            picture = np.ascontiguousarray(np.rot90(picture))
        shot = raw(picture)
        if 70 <= number < 140:
            shot = to_jpeg(picture.repeat(2, axis=0).repeat(2, axis=1))
        camera._show_picture(shot, camera.clock.now_s())
        frame = camera.latest()
        assert frame is not None
        return frame

    monkeypatch.setattr(SimCamera, "capture", capture)
    driven = drive_in_simulator(tmp_path, "default-8")
    several = open_episode(driven.path)
    taught, ids = taught_frames(several), list(several.frames)
    assert {entry.size for entry in several.frames.values()} == {(160, 120), (320, 240), (120, 160)}
    again = make_policy("default-8")
    assert learn_again(again, [(several, Notes())]).missing_frames == 0
    assert same_nodes(again.get_state(), driven.state)

    assert write_tub(several, Notes(), tmp_path / "tub") == len(taught)
    assert write_npz(several, Notes(), tmp_path / "x.npz") == len(taught)
    assert write_look(several, Notes(), tmp_path / "film.mp4") == len(ids)
    turned = Notes(edits=(Edit(verb="delete", ranges=((ids[0], ids[150]),)),))
    write_lerobot([(several, Notes()), (several, turned)], tmp_path / "set")
    assert read_info(tmp_path / "set")["features"][CAMERA]["shape"] == [120, 160, 3]
    for film in (FILM, FILM.replace("000.mp4", "001.mp4")):
        assert {picture.shape for picture in decoded(tmp_path / "set" / film)[0]} == {(120, 160, 3)}
    for source in (*find_drives(tmp_path / "tub"), *find_drives(tmp_path / "set")):
        report = ImportReport()
        drive = source.read(Reading(threshold=0.1), report)
        assert write_episode(drive, tmp_path / f"{source.name}.mcap") > 0
        assert report.skipped == []


def test_a_film_to_look_at_plays(episode: Episode, tmp_path: Path) -> None:
    count = write_look(episode, Notes(), tmp_path / "film.mp4")
    shown, _ = decoded(tmp_path / "film.mp4")
    assert len(shown) == count == len(episode.frames)
    for frame_id, picture in zip(episode.frames, shown, strict=True):
        seen, bar = np.split(picture.astype(int), [480])
        taken = to_rgb(episode.frame(frame_id)).repeat(4, axis=0).repeat(4, axis=1)
        assert np.abs(seen - taken).mean() < 6
        assert np.abs(bar[:, -50:] - 24).max() < 6
        assert bar[:, :200].max() > 200


@pytest.mark.parametrize(("height", "width"), [(1, 1), (161, 213), (479, 641), (240, 320)])
def test_a_film_shows_the_colours_of_pictures_of_any_size(height: int, width: int) -> None:
    """Pictures of odd sizes, enlarged by odd and even factors."""
    colour = np.array([200, 40, 90], np.uint8)
    picture = np.full((height, width, 3), colour)
    moment = EpisodeFrame(frame_id=1, at_s=0.0, label=None, is_relabelled=False, is_deleted=False)
    shown = _captioned(picture, moment).to_ndarray(format="rgb24")
    assert shown.shape[0] >= 480 and not shown.shape[0] % 2 and not shown.shape[1] % 2
    assert np.abs(shown[:-_BAR_PX].astype(int) - colour).max() < 5


def test_a_film_needs_pictures_of_more_than_one_row(episode: Episode, tmp_path: Path) -> None:
    ids, path = list(episode.frames), tmp_path / "film.mp4"
    notes = Notes().with_edit(Edit(verb="delete", ranges=((ids[0], ids[-1]),)))
    with pytest.raises(RecordingError, match="no pictures"):
        write_look(episode, notes, path)
    for sides in ((1, 8), (8, 1)):
        with pytest.raises(RecordingError, match="two pixels"):
            write_film([np.zeros((*sides, 3), np.uint8)], path, 10)


def test_a_tub_counts_its_lines_as_donkeycar_reads_them(episode: Episode, tmp_path: Path) -> None:
    count = write_tub(episode, Notes(), tmp_path / "tub", taught_only=False)
    lines = (tmp_path / "tub/manifest.json").read_text().splitlines()
    inputs, types, _, _, catalogs = map(json.loads, lines)
    assert len(inputs) == len(types) and catalogs["current_index"] == count
    text = (tmp_path / "tub/catalog_0.catalog").read_text()
    lengths = json.loads((tmp_path / "tub/catalog_0.catalog_manifest").read_text())["line_lengths"]
    assert [len(line) + 1 for line in text.splitlines()] == lengths
    first = json.loads(text.splitlines()[0])
    assert (tmp_path / "tub/images" / first["cam/image_array"]).is_file()
    proposed = [json.loads(line).get("pilot/angle") for line in text.splitlines()]
    assert {"pilot/angle", "pilot/throttle"} < {*inputs} and {-1.0, 0.0} <= {*proposed}


def test_poses_are_drawn_by_foxglove_and_rerun(episode: Episode) -> None:
    with episode.path.open("rb") as file:
        found = list(make_reader(file).iter_messages(topics=["/pose"]))
    [(schema, channel, message), *_] = found
    assert len(found) == len(episode.frames) and schema is not None
    assert schema.name == "foxglove.PoseInFrame"
    assert (schema.encoding, channel.message_encoding) == ("protobuf", "protobuf")
    drawn = read_protobuf(schema.name, schema.data, message.data)
    turn = drawn.pose.orientation
    assert turn.z**2 + turn.w**2 == pytest.approx(1.0)
    assert (drawn.frame_id, drawn.timestamp.ToNanoseconds()) == ("floor", message.log_time)


def test_measurements_stay_with_every_copy_and_export(tmp_path: Path) -> None:
    robot = RecordedBench(tmp_path)
    robot.recorder.write_result("lost", {})  # there is no recording yet
    robot.start(Mode.TRAIN, 0)
    for scene in range(30):
        robot.step(scene, Action.FORWARD)
        if scene == 20:
            robot.recorder.write_result("race", {"metres": 1.5, "not": math.nan, "who": [1]})
    episode = robot.episode()
    [result] = episode.results
    assert result.pop("at_s") == pytest.approx(20 / 30 * episode.duration_s, abs=0.2)
    assert result == {"of": "race", "metres": 1.5}
    with (tmp_path / "edited.mcap").open("wb") as file:
        write_edited(episode, Notes(edits=(trim(episode.frames, 10, 29),)), file)
    copy_recording(episode.path, tmp_path / "copy.mcap", ImportReport())
    for name in ("edited", "copy"):
        assert [one["metres"] for one in open_episode(tmp_path / f"{name}.mcap").results] == [1.5]
    write_tub(episode, Notes(), tmp_path / "tub")
    write_folder(episode, Notes(), tmp_path / "folder")
    write_lerobot([(episode, Notes())], tmp_path / "set")
    write_npz(episode, Notes(), tmp_path / "one.npz")
    tub = json.loads((tmp_path / "tub/manifest.json").read_text().splitlines()[2])
    [row] = json.loads((tmp_path / "set/meta/drivelesson_results.json").read_text())
    assert row.pop("episode") == episode.id
    assert tub["drivelesson_results"] == [row] == episode.results
    assert json.loads((tmp_path / "folder/results.json").read_text()) == episode.results
    assert json.loads(str(np.load(tmp_path / "one.npz")["meta"]))["results"] == episode.results
