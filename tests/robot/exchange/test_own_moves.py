"""A driver's own moves survive every export and import, with their points or without."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from robot.driver import Move, describe, names, point_of
from robot.errors import RecordingError
from robot.exchange.folder import write_folder
from robot.exchange.lerobot import write_lerobot
from robot.exchange.tub import write_tub
from robot.recordings.edits import Notes
from robot.recordings.episode import Episode, open_episode
from robot.types import Action
from tests.robot.exchange.imported import drive_at, import_from, import_pictures, taught_labels

STEERED = tuple(
    Move(Action(f"steer_{place}"), steering=(place - 2) / 2, throttle=0.3) for place in range(5)
)
PLAIN = tuple(Move(Action(name), name.title()) for name in ("fast", "slow", "push"))


CURVED = (
    Move(Action.LEFT, steering=-0.5, throttle=0.25),
    Move(Action("drift"), steering=0.75, throttle=1.0),
    *describe([Action.FORWARD]),
)


def write_dataset(episode: Episode, notes: Notes, folder: Path) -> int:
    return write_lerobot([(episode, notes)], folder, fps=10)


def drive(folder: Path, declared: tuple[Move, ...], labels: list[Action | None]) -> Episode:
    pictures = np.random.default_rng(7).integers(0, 255, (len(labels), 24, 32, 3), np.uint8)
    path = folder / "own.mcap"
    return import_pictures(path, pictures, labels, moves=names(declared), declared_moves=declared)


def all_labels(declared: tuple[Move, ...]) -> list[Action | None]:
    return [*names(declared), None, *reversed(names(declared))] * 2


@pytest.mark.parametrize("declared", [STEERED, PLAIN], ids=["steered", "plain"])
@pytest.mark.parametrize("write", [write_tub, write_folder], ids=["tub", "folder"])
def test_labels_come_back_by_name(tmp_path: Path, declared: tuple[Move, ...], write) -> None:  # type: ignore[no-untyped-def]
    episode = drive(tmp_path, declared, all_labels(declared))
    write(episode, Notes(), tmp_path / "out")
    back = import_from(tmp_path / "out", tmp_path / "back.mcap")
    assert list(taught_labels(back).values()) == list(taught_labels(episode).values())
    assert set(back.moves) == set(names(declared))


def test_a_tub_carries_the_numbers_there_and_back(tmp_path: Path) -> None:
    episode = drive(tmp_path, STEERED, all_labels(STEERED))
    write_tub(episode, Notes(), tmp_path / "tub", taught_only=False)
    lines = (tmp_path / "tub/catalog_0.catalog").read_text().splitlines()
    for record in map(json.loads, lines):
        label = record["drivelesson/label"]
        point = point_of(Action(label or "stop"), STEERED)
        assert (record["user/angle"], record["user/throttle"]) == point
    back = import_from(tmp_path / "tub", tmp_path / "back.mcap").declared_moves
    assert {move.name: move.point for move in back} == {m.name: m.point for m in STEERED}


@pytest.mark.parametrize("write", [write_tub, write_folder, write_dataset])
def test_what_moves_do_on_that_body_comes_back(tmp_path: Path, write: Callable[..., int]) -> None:
    labels = all_labels(CURVED)
    write(drive(tmp_path, CURVED, labels), Notes(), tmp_path / "out")
    back = import_from(tmp_path / "out", tmp_path / "back.mcap")
    assert list(taught_labels(back).values()) == [label for label in labels if label]
    for move in CURVED:
        assert point_of(move.name, back.declared_moves) == move.point


@pytest.mark.parametrize("n_edited", [1, 3])
def test_an_edited_tub_says_of_a_move_what_most_of_its_records_say(
    tmp_path: Path, n_edited: int
) -> None:
    write_tub(drive(tmp_path, CURVED, all_labels(CURVED)), Notes(), tmp_path / "tub")
    catalog = tmp_path / "tub/catalog_0.catalog"
    records = [json.loads(line) for line in catalog.read_text().splitlines()]
    lefts = [record for record in records if record["drivelesson/label"] == "left"]
    for number, record in enumerate(lefts[:n_edited]):
        record["user/angle"] = number / 10
    catalog.write_text("".join(json.dumps(record) + "\n" for record in records))
    back = drive_at(tmp_path / "tub")
    left = CURVED[0].point if n_edited == 1 else point_of(Action.LEFT)
    assert point_of(Action.LEFT, back.declared_moves) == left
    assert point_of(CURVED[1].name, back.declared_moves) == CURVED[1].point
    assert all(shot.label for shot in back.shots) and len(back.shots) == len(records)


def test_a_tub_of_moves_without_points_claims_no_angle(tmp_path: Path) -> None:
    episode = drive(tmp_path, PLAIN, all_labels(PLAIN))
    write_tub(episode, Notes(), tmp_path / "tub")
    inputs = json.loads((tmp_path / "tub/manifest.json").read_text().splitlines()[0])
    record = json.loads((tmp_path / "tub/catalog_0.catalog").read_text().splitlines()[0])
    assert not {"user/angle", "user/throttle"} & (set(inputs) | set(record))
    assert set(inputs) <= set(record)


@pytest.mark.parametrize("declared", [STEERED, PLAIN], ids=["steered", "plain"])
def test_lerobot_has_numbers_or_one_place_a_move(
    tmp_path: Path, declared: tuple[Move, ...]
) -> None:
    labels = all_labels(declared)
    write_lerobot([(drive(tmp_path, declared, labels), Notes())], tmp_path / "set", fps=10)
    feature = json.loads((tmp_path / "set/meta/info.json").read_text())["features"]["action"]
    rows = pq.read_table(tmp_path / "set/data/chunk-000/file-000.parquet")["action"].to_pylist()
    assert len(rows) == len(labels) and feature["shape"] == [len(feature["names"])]
    for label, row in zip(labels, rows, strict=True):
        if declared is STEERED:
            assert feature["names"] == ["steering.pos", "throttle.vel"]
            point = point_of(label or Action.STOP, declared)
            assert tuple(row) == pytest.approx(point)
        else:
            assert row == [float(name == label) for name in feature["names"]]
            assert sorted(feature["names"]) == sorted(names(declared))


def test_a_damaged_declaration_is_a_broken_recording(tmp_path: Path) -> None:
    drive(tmp_path, PLAIN, all_labels(PLAIN))
    path = tmp_path / "own.mcap"
    path.write_bytes(path.read_bytes().replace(b'"steering": null', b'"steering": "up"', 1))
    with pytest.raises(RecordingError):
        open_episode(path)
