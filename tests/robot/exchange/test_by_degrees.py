"""Steering by degrees survives export and import in every format, exact to float32."""

from __future__ import annotations

import json
import random
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from robot.driver import Move
from robot.errors import RecordingError
from robot.exchange.film import to_jpeg
from robot.exchange.folder import write_folder
from robot.exchange.lerobot import write_lerobot
from robot.exchange.npz import load_recording, write_npz
from robot.exchange.steering import read_meant
from robot.exchange.tub import write_tub
from robot.recordings.edits import Notes
from robot.recordings.episode import Episode, open_episode, taught_frames
from robot.types import DEFAULT_MOVES, Action, Point
from tests.robot.exchange.imported import import_from, import_pictures

DRIFT = Move(Action("drift"), "Drift", steering=-0.7, throttle=0.9)
PUSH = Move(Action("push"), "Push")
Examples = list[tuple[Action, Point | None]]


def driven(path: Path, seed: int, own_move: Move | None = None) -> Episode:
    """Return an episode in which a pilot steers by degrees, sometimes by a move, or not at all."""
    chance, pilot = random.Random(seed), list[tuple[Action | None, Point | None]]()
    for index in range(30):
        point = Point(*(np.float32(chance.uniform(low, 1)).item() for low in (-1, 0.01)))
        by_move = own_move.name if own_move else Action.LEFT
        others = {3: (by_move, None), 4: (None, None)}
        pilot.append(others.get(index % 5, (read_meant(point)[0], point)))
    return import_pictures(
        path,
        np.random.default_rng(seed).integers(0, 256, (30, 120, 160, 3), np.uint8),
        [label for label, _ in pilot],
        points=[point for _, point in pilot],
        moves=(*DEFAULT_MOVES, own_move.name) if own_move else DEFAULT_MOVES,
        declared_moves=(own_move,) if own_move else (),
    )


def examples(episode: Episode) -> Examples:
    return [(each.label, each.point) for _, each in sorted(taught_frames(episode).items())]


def back_from(path: Path, folder: Path) -> Examples:
    return examples(import_from(path, folder / "back.mcap"))


def as_lerobot(episode: Episode, notes: Notes, folder: Path) -> None:
    pytest.importorskip("pyarrow")
    pytest.importorskip("av")
    write_lerobot([(episode, notes)], folder, fps=10)


FORMS: dict[str, Callable[..., object]] = {
    "tub": write_tub,
    "folder": write_folder,
    "lerobot": as_lerobot,
    "drive.npz": write_npz,
}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("own_move", [None, DRIFT, PUSH], ids=["three moves", "drift", "push"])
def test_out_and_in_again_a_pilot_means_the_same(
    form: str, own_move: Move | None, tmp_path: Path
) -> None:
    """A tub and a dataset omit the numbers if one move has none, because a zero would mean
    standing."""
    episode = driven(tmp_path / "drive.mcap", seed=3, own_move=own_move)
    meant = examples(episode)
    assert {point is None for _, point in meant} == {True, False} and len(meant) == 24
    FORMS[form](episode, Notes(), tmp_path / form)
    if form == "drive.npz":  # which has three labels
        meant = [(label, point) for label, point in meant if label in DEFAULT_MOVES]
    if own_move is PUSH and form in ("tub", "lerobot"):
        meant = [(label, None) for label, _ in meant]
    assert back_from(tmp_path / form, tmp_path) == meant


@pytest.mark.parametrize("form", FORMS)
def test_a_drive_by_moves_has_nothing_more(form: str, tmp_path: Path) -> None:
    black = np.zeros((4, 120, 160, 3), np.uint8)
    episode = import_pictures(tmp_path / "d.mcap", black, [Action.LEFT] * 4)
    FORMS[form](episode, Notes(), tmp_path / form)
    written = (tmp_path / form).rglob("*.catalog")
    assert not any("degrees" in path.read_text() for path in written)
    assert back_from(tmp_path / form, tmp_path) == [(Action.LEFT, None)] * 4


@pytest.mark.parametrize("seed", range(3))
def test_a_car_that_writes_float32_is_read_exactly(seed: int, tmp_path: Path) -> None:
    chance = random.Random(seed)
    points = [
        Point(
            *(
                struct.unpack("<f", struct.pack("<f", chance.uniform(low, 1)))[0]
                for low in (-1, 0.01)
            )
        )
        for _ in range(20)
    ]
    (tmp_path / "tub").mkdir()
    picture = to_jpeg(np.zeros((120, 160, 3), np.uint8)).data
    for number, point in enumerate(points):
        name = f"{number}_cam.jpg"
        (tmp_path / "tub" / name).write_bytes(picture)
        record = {"cam/image_array": name, "user/angle": point[0], "user/throttle": point[1]}
        (tmp_path / f"tub/record_{number}.json").write_text(json.dumps(record))
    assert [point for _, point in back_from(tmp_path / "tub", tmp_path)] == points
    write_tub(open_episode(tmp_path / "back.mcap"), Notes(), tmp_path / "again")
    catalog = (tmp_path / "again/catalog_0.catalog").read_text()
    records = [json.loads(line) for line in catalog.splitlines()]
    told = [[np.float32(r[f"user/{n}"]) for n in ("angle", "throttle")] for r in records]
    assert np.array_equal(np.array(told), np.array(points, np.float32))


@pytest.mark.parametrize("wrong", [np.float32(1.5), np.float32(np.inf)])
def test_a_recording_with_impossible_steering_is_refused(wrong: float, tmp_path: Path) -> None:
    write_npz(driven(tmp_path / "drive.mcap", seed=1), Notes(), tmp_path / "a.npz")
    arrays = dict(np.load(tmp_path / "a.npz"))
    arrays["angle"][2] = wrong
    np.savez(tmp_path / "b.npz", **arrays)
    with pytest.raises(RecordingError, match="outside -1 to 1"):
        load_recording(tmp_path / "b.npz")
    np.savez(tmp_path / "c.npz", **{**arrays, "angle": arrays["angle"][1:]})
    with pytest.raises(RecordingError, match="unexpected form"):
        load_recording(tmp_path / "c.npz")
