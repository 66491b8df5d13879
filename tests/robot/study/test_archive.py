"""The table is computed only from plan and logs, and is the same on every machine."""

import csv
import io
import os
import re
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from robot.errors import ConfigurationError, RecordingError
from robot.study.archive import pack, rebuild, report
from robot.study.profile import THRESHOLDS_M, behavior_profile, compare
from robot.study.rows import columns
from robot.types import Action

from .scripted import SMALL_PLAN, driving, logs_of, small_plan


def table(logs: dict[str, bytes], plan: str = SMALL_PLAN) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(rebuild(plan, logs)["phases.csv"])))


def repacked(file: Path, change: Callable[[str, bytes], bytes]) -> Path:
    """Write the zip file of two sessions, with each file changed by `change`."""
    packed = io.BytesIO(pack(SMALL_PLAN, logs_of(2)))
    with zipfile.ZipFile(packed) as old, zipfile.ZipFile(file, "w") as new:
        new.mkdir("events")
        for name in old.namelist():
            new.writestr(name, change(name, old.read(name)))
    return file


def test_there_is_one_row_a_participant_and_phase_and_one_with_the_answers():
    assert table({}) == []
    rows = table(logs_of(4))
    found = {(r["participant"], r["condition"], r["phase"]) for r in rows}
    assert len(rows) == len(found) == 4 * 2 * 4
    assert {phase for *_, phase in found} == {"teach", "correct", "alone", "questions"}
    assert tuple(rows[0]) == columns(small_plan())
    assert all(r["is_complete"] == "1" for r in rows)
    alone = [r for r in rows if r["phase"] == "alone"]
    assert all(float(r["ssd"]) > 0 and r["frames_pilot"] == "0" for r in alone)
    first = [r["condition"] for r in alone if r["position"] == "1"]
    assert sorted(first) == ["long", "long", "short", "short"]
    for row in (r for r in rows if r["phase"] == "questions"):
        tlx = [int(row[name]) for name in row if name.startswith("tlx_")]
        assert float(row["nasa_tlx"]) == pytest.approx(sum(tlx) / 6, abs=1e-6)


def test_an_unfinished_session_counts_and_the_last_attempt_of_a_condition_counts():
    def phases():
        rows = table({"P01": person.log})
        return [(r["phase"], r["attempt"], r["is_complete"]) for r in rows]

    person = driving(4.0)
    assert phases() == [("teach", "1", "1"), ("correct", "1", "0")]
    person.begin()
    person.drive(1.0)
    assert phases() == [("teach", "2", "0")]


def test_drives_stay_under_their_own_condition_after_the_plan_was_changed():
    """A condition that is added later changes the order of conditions in each slot."""
    logs = logs_of(2)
    added = '[[condition]]\nname = "third"\n[[condition]]\nname = "short"'
    later = SMALL_PLAN.replace('[[condition]]\nname = "short"', added)
    first = table(logs)
    assert {row["condition"] for row in first} == {"short", "long"}
    assert table(logs, later) == first
    other = SMALL_PLAN.replace('name = "short"', 'name = "brief"')
    with pytest.raises(RecordingError, match=r"P01.csv: the plan no longer has the condition 'sho"):
        rebuild(other, logs)


def test_a_zip_gives_the_same_table_in_another_process(tmp_path):
    file = tmp_path / "study.zip"
    file.write_bytes(pack(SMALL_PLAN, logs_of(4, seed=3)))
    command = [sys.executable, "-m", "server", "study", "report", str(file), "--out", "again"]
    root = Path(__file__).parents[3]
    away = {"LC_ALL": "C", "TZ": "Asia/Tokyo", "PYTHONHASHSEED": "9", "PYTHONPATH": str(root)}
    options: dict[str, Any] = {"env": {**os.environ, **away}, "capture_output": True, "text": True}
    done = subprocess.run(command, cwd=tmp_path, **options, check=False)
    assert done.returncode == 0, done.stderr
    with zipfile.ZipFile(file) as packed:
        assert (tmp_path / "again/phases.csv").read_bytes() == packed.read("phases.csv")
    example = root / "docs/examples/study/describe.py"
    said = subprocess.check_output([sys.executable, example, file], text=True)
    assert re.search(r"alone: ssd +short +n=4 mean=", said), said
    assert re.search(r"questions: trust +(long - short|short - long): n=4 mean=", said), said


@pytest.mark.parametrize("fault", ["no zip", "damaged", "no plan", "strange name"])
def test_a_file_that_is_not_a_study_is_refused_with_a_sentence(tmp_path, fault):
    file = tmp_path / "study.zip"
    if fault == "no zip":
        file.write_bytes(b"PK\x03\x04 and no more")
    elif fault == "damaged":
        data = bytearray(pack(SMALL_PLAN, {}))
        data[60:90] = bytes(range(225, 255))  # changes the first file's packed bytes
        file.write_bytes(data)
    else:
        with zipfile.ZipFile(file, "w") as archive:
            if fault != "no plan":
                archive.writestr("plan.toml", SMALL_PLAN)
                archive.writestr("events/../../evil.csv", "")
    with pytest.raises(ConfigurationError, match=r"study\.zip"):
        report(file, tmp_path / "out")
    assert not (tmp_path / "evil.csv").exists()


def test_a_zip_that_a_spreadsheet_saved_gives_the_same_and_a_changed_table_is_named(tmp_path):
    """The zip has a folder among its entries, and logs with Windows' line ends and byte order
    marks."""

    def saved(name, data):
        is_saved = name.startswith("events/") or name == "plan.toml"
        return b"\xef\xbb\xbf" + data.replace(b"\n", b"\r\n") if is_saved else data

    file, out = tmp_path / "study.zip", tmp_path / "out"
    assert report(repacked(file, saved), out)[1] == []
    changed = {"phases.csv": b"x"}
    repacked(file, lambda name, data: data + changed.get(name, b""))
    assert report(file, out) == ([], ["phases.csv"])


F, L, R = Action.FORWARD, Action.LEFT, Action.RIGHT


@pytest.mark.parametrize("folder", ["", "walk/"])
def test_a_zip_that_a_mac_packed_again_gives_the_same(folder: str, tmp_path: Path) -> None:
    packed = io.BytesIO(pack(SMALL_PLAN, logs_of(2)))
    with zipfile.ZipFile(packed) as old, zipfile.ZipFile(tmp_path / "walk.zip", "w") as new:
        for name in old.namelist():
            new.writestr(f"{folder}{name}", old.read(name))
            new.writestr(f"__MACOSX/{folder}._{name.rpartition('/')[2]}", b"attributes")
        new.writestr(f"{folder}events/.DS_Store", b"icons")
    assert report(tmp_path / "walk.zip", tmp_path / "out") == (["phases.csv"], [])


def test_the_thresholds_are_the_papers():
    assert len(THRESHOLDS_M) == 201
    assert [*THRESHOLDS_M[:2], THRESHOLDS_M[-1]] == pytest.approx([0, 0.02, 4.0])


def test_a_profile_is_the_share_of_readings_below_each_threshold():
    profile = behavior_profile([F, F, L, F, F, Action.STOP], [0.03, 0.05, 0.01, 0.05, 9.0, 0.0])
    assert set(profile) == {F, L}
    # Of FORWARD's four readings (3, 5 and 5 cm, and far), 0, 0, 1, 3 are below 0, 2, 4, 6 cm.
    assert profile[F][:4].tolist() == [0, 0, 0.25, 0.75]
    assert profile[F][-1] == 0.75
    assert profile[L][:3].tolist() == [0, 1, 1]
    assert behavior_profile([F], [0.0])[F][:2].tolist() == [0, 1], "0.0 is not below 0.0"


def test_the_ssd_adds_squares_over_moves_and_thresholds():
    teacher = behavior_profile([F, L, L], [0.03, 0.03, 0.05])
    robot = behavior_profile([F, L], [0.07, 0.03])
    difference = compare(teacher, robot, (F, L))
    # FORWARD: 1 against 0 at c = 0.04 and 0.06, equal from 0.08 on. LEFT: 0.5 against 1 at 0.04.
    assert difference.per_move == {F: pytest.approx(2.0), L: pytest.approx(0.25)}
    assert difference.ssd == difference.made == pytest.approx(2.25)
    assert difference.never_by_robot == ()
    assert compare(teacher, teacher, (F, L)).ssd == 0


def test_a_move_never_made_counts_as_nothing_below_any_distance_and_is_named():
    teacher = behavior_profile([F, L], [0.03, 3.95])
    robot = behavior_profile([F], [0.03])
    difference = compare(teacher, robot, (F, L, R))
    # The teacher's only left turn was at 3.95 m: below 3.96, 3.98 and 4.00 m.
    assert difference.ssd == pytest.approx(3.0)
    assert difference.made == 0
    assert difference.never_by_robot == (L, R)
    assert difference.never_by_teacher == (R,)


def test_moves_and_distances_belong_together():
    with pytest.raises(ValueError, match="2 moves"):
        behavior_profile([F, F], [1.0])
