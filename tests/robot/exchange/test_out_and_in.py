"""Labels, points and a driver's own moves survive an export and import, exact to float32."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robot.errors import RecordingError
from robot.exchange.folder import write_folder
from robot.exchange.lerobot import write_lerobot
from robot.exchange.npz import write_npz
from robot.exchange.steering import read_meant
from robot.exchange.tub import write_tub
from robot.moves import Move, describe, names, point_of
from robot.policy.registry import make_policy
from robot.recordings.edits import Notes
from robot.recordings.episode import Episode, open_episode, taught_frames
from robot.recordings.teaching import learn_again
from robot.store.models.model import same_nodes
from robot.types import DEFAULT_MOVES, Action, Point
from tests.kit.sizes import crossed

from .imported import drive_at, import_from, import_pictures, pixels, taught_labels
from .sim_drive import drive_in_simulator

DRIFT = Move(Action("drift"), "Drift", steering=-0.7, throttle=0.9)
PUSH = Move(Action("push"), "Push")
STEERED = tuple(
    Move(Action(f"steer_{place}"), steering=(place - 2) / 2, throttle=0.3) for place in range(5)
)
PLAIN = tuple(Move(Action(name), name.title()) for name in ("fast", "slow", "push"))
CURVED = (
    Move(Action.LEFT, steering=-0.5, throttle=0.25),
    Move(Action("drift"), steering=0.75, throttle=1.0),
    *describe([Action.FORWARD]),
)


def as_lerobot(episode: Episode, notes: Notes, folder: Path) -> int:
    return write_lerobot([(episode, notes)], folder, fps=10)


FORMS: dict[str, Callable[[Episode, Notes, Path], object]] = {
    "tub": write_tub,
    "folder": write_folder,
    "lerobot": as_lerobot,
    "drive.npz": write_npz,
}


def some_point(chance: random.Random) -> Point:
    return Point(*(np.float32(chance.uniform(low, 1)).item() for low in (-1, 0.01)))


def by_moves(folder: Path, declared: tuple[Move, ...]) -> tuple[Episode, list[Action | None]]:
    """Return an episode with each of a body's own moves, and the label of each picture."""
    labels = [*names(declared), None, *reversed(names(declared))] * 2
    shown = [pixels(n % 13) for n in range(len(labels))]
    moves: dict[str, Any] = {"moves": names(declared), "declared_moves": declared}
    return import_pictures(folder / "own.mcap", shown, labels, **moves), labels


def examples(episode: Episode) -> list[tuple[Action, Point | None]]:
    return [(each.label, each.point) for _, each in sorted(taught_frames(episode).items())]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("own_move", [None, DRIFT, PUSH], ids=["three moves", "drift", "push"])
def test_labels_and_points_are_the_same_after_export_and_import(
    form: str, own_move: Move | None, tmp_path: Path
) -> None:
    """A pilot steers proportionally or by a move, or does not steer.

    A tub or dataset has no numbers if one move has none, because a zero would mean standing.
    """
    chance, by_move = random.Random(3), own_move.name if own_move else Action.LEFT
    points = [some_point(chance) if index % 5 < 3 else None for index in range(30)]
    episode = import_pictures(
        tmp_path / "drive.mcap",
        [pixels(n % 13) for n in range(30)],
        [
            read_meant(point)[0] if point else (None, by_move)[index % 2]
            for index, point in enumerate(points)
        ],
        points=points,
        moves=(*DEFAULT_MOVES, own_move.name) if own_move else DEFAULT_MOVES,
        declared_moves=(own_move,) if own_move else (),
    )
    meant = examples(episode)
    assert {point is None for _, point in meant} == {True, False} and len(meant) == 24
    FORMS[form](episode, Notes(), tmp_path / form)
    if form == "drive.npz":  # this format has only three labels
        meant = [(label, point) for label, point in meant if label in DEFAULT_MOVES]
    if own_move is PUSH and form in ("tub", "lerobot"):
        meant = [(label, None) for label, _ in meant]
    assert examples(import_from(tmp_path / form, tmp_path / "back.mcap")) == meant


@crossed(declared=[STEERED, PLAIN, CURVED], form=["tub", "folder", "lerobot"])
def test_a_bodys_own_moves_are_restored_with_their_declarations(
    tmp_path: Path, declared: tuple[Move, ...], form: str
) -> None:
    episode, labels = by_moves(tmp_path, declared)
    FORMS[form](episode, Notes(), tmp_path / form)
    back = import_from(tmp_path / form, tmp_path / "back.mcap")
    assert list(taught_labels(back).values()) == [label for label in labels if label]
    usual = set(DEFAULT_MOVES) if declared is CURVED else set()
    assert set(back.moves) - usual == set(names(declared)) - usual
    if declared is not PLAIN:
        points = [point_of(move.name, back.declared_moves) for move in declared]
        assert np.array_equal(np.float32(points), np.float32([move.point for move in declared]))


@pytest.mark.parametrize("declared", [STEERED, PLAIN], ids=["steered", "plain"])
def test_tubs_and_datasets_have_numbers_if_every_move_has_some(
    tmp_path: Path, declared: tuple[Move, ...]
) -> None:
    import pyarrow.parquet as pq

    episode, labels = by_moves(tmp_path, declared)
    write_tub(episode, Notes(), tmp_path / "tub", taught_only=False)
    as_lerobot(episode, Notes(), tmp_path / "set")
    inputs = json.loads((tmp_path / "tub/manifest.json").read_text().splitlines()[0])
    lines = (tmp_path / "tub/catalog_0.catalog").read_text().splitlines()
    feature = json.loads((tmp_path / "set/meta/info.json").read_text())["features"]["action"]
    rows = pq.read_table(tmp_path / "set/data/chunk-000/file-000.parquet")["action"].to_pylist()
    steering = {"user/angle", "user/throttle"}
    if declared is STEERED:
        points = [point_of(label or Action.STOP, declared) for label in labels]
        records = map(json.loads, lines)
        assert [(one["user/angle"], one["user/throttle"]) for one in records] == points
        assert feature["names"] == ["steering.pos", "throttle.vel"] and steering <= {*inputs}
        assert np.array(rows) == pytest.approx(np.array(points))
    else:
        assert not any(steering & {*json.loads(line), *inputs} for line in lines)
        assert sorted(feature["names"]) == sorted(names(declared))
        assert rows == [[float(name == label) for name in feature["names"]] for label in labels]


@pytest.mark.parametrize("n_edited", [1, 3])
def test_an_edited_tub_says_of_a_move_what_most_of_its_records_say(
    tmp_path: Path, n_edited: int
) -> None:
    write_tub(by_moves(tmp_path, CURVED)[0], Notes(), tmp_path / "tub")
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


def test_a_damaged_declaration_is_a_broken_recording(tmp_path: Path) -> None:
    path = by_moves(tmp_path, PLAIN)[0].path
    path.write_bytes(path.read_bytes().replace(b'"steering": null', b'"steering": "up"', 1))
    with pytest.raises(RecordingError):
        open_episode(path)


def test_an_exported_and_imported_drive_teaches_the_same_nodes(tmp_path: Path) -> None:
    driven = drive_in_simulator(tmp_path, "default-32", steps=120, undo_s=1.0)
    episode = open_episode(driven.path)
    assert driven.lessons > 50
    assert write_tub(episode, Notes(), tmp_path / "tub") == driven.lessons
    write_folder(episode, Notes(), tmp_path / "folder")
    for form, source in (("tub", "donkeycar tub v2"), ("folder", "")):
        back = import_from(tmp_path / form, tmp_path / f"{form}.mcap")
        assert source in back.run["source"]
        policy = make_policy("default-32", back.moves)
        learn_again(policy, [(back, Notes())])
        assert same_nodes(policy.get_state(), driven.state)
    gaps = [np.diff([f.captured_s for f in e.frames.values()]) for e in (episode, back)]
    assert np.allclose(*gaps, atol=2e-6)
