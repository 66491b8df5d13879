"""The table is computed only from plan and logs, and is the same on every machine."""

from __future__ import annotations

import csv
import io
import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from robot.errors import ConfigurationError, RecordingError
from robot.study.archive import pack, rebuild, report
from robot.study.rows import columns

from .scripted import SMALL_PLAN, Participant, logs_of, small_plan


def table(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def test_there_is_one_row_a_participant_and_phase_and_one_with_the_answers() -> None:
    plan = small_plan()
    rows = table(rebuild(SMALL_PLAN, logs_of(plan, 4))["phases.csv"])
    found = {(r["participant"], r["condition"], r["phase"]) for r in rows}
    phases = ("teach", "correct", "alone", "questions")
    assert len(rows) == len(found) == 4 * 2 * 4
    assert {phase for *_, phase in found} == set(phases)
    assert tuple(rows[0]) == columns(plan)
    assert all(r["is_complete"] == "1" for r in rows)
    alone = [r for r in rows if r["phase"] == "alone"]
    assert all(float(r["ssd"]) > 0 and r["frames_pilot"] == "0" for r in alone)
    asked = [r for r in rows if r["phase"] == "questions"]
    for row in asked:
        tlx = [int(row[name]) for name in row if name.startswith("tlx_")]
        assert float(row["nasa_tlx"]) == pytest.approx(sum(tlx) / 6, abs=1e-6)


def test_the_order_is_balanced_over_the_participants() -> None:
    rows = table(rebuild(SMALL_PLAN, logs_of(small_plan(), 4))["phases.csv"])
    first = [r["condition"] for r in rows if r["position"] == "1" and r["phase"] == "alone"]
    assert sorted(first) == ["long", "long", "short", "short"]


def test_a_session_that_was_left_counts_as_far_as_it_came() -> None:
    plan = small_plan()
    person = Participant(plan, "P05", 0)
    person.consent()
    person.begin()
    person.drive(4.0)
    files = rebuild(SMALL_PLAN, {"P05": person.log})
    rows = table(files["phases.csv"])
    assert [(r["phase"], r["is_complete"]) for r in rows] == [("teach", "1"), ("correct", "0")]


def test_of_a_condition_begun_anew_the_last_attempt_counts() -> None:
    person = Participant(small_plan(), "P05", 0)
    person.consent()
    person.begin()
    person.drive(4.0)
    person.begin()
    person.drive(1.0)
    rows = table(rebuild(SMALL_PLAN, {"P05": person.log})["phases.csv"])
    assert [(r["phase"], r["attempt"], r["is_complete"]) for r in rows] == [("teach", "2", "0")]


def test_what_was_driven_stands_under_its_own_condition_whatever_became_of_the_plan() -> None:
    """A condition that is added later gives the same slots other orders."""
    logs = logs_of(small_plan(), 2)
    added = '[[condition]]\nname = "third"\n[[condition]]\nname = "short"'
    later = SMALL_PLAN.replace('[[condition]]\nname = "short"', added)
    first, then = (table(rebuild(text, logs)["phases.csv"]) for text in (SMALL_PLAN, later))
    assert {row["condition"] for row in first} == {"short", "long"}
    assert then == first
    other = SMALL_PLAN.replace('name = "short"', 'name = "brief"')
    with pytest.raises(RecordingError, match=r"P01.csv: the plan has no condition 'short'"):
        rebuild(other, logs)


def test_without_anybody_the_table_is_empty_and_there() -> None:
    assert table(rebuild(SMALL_PLAN, {})["phases.csv"]) == []


def test_a_zip_gives_the_same_table_in_another_process(tmp_path: Path) -> None:
    file = tmp_path / "study.zip"
    file.write_bytes(pack(SMALL_PLAN, logs_of(small_plan(), 4, seed=3)))
    command = [sys.executable, "-m", "server", "study", "report", str(file), "--out", "again"]
    root = Path(__file__).parents[3]
    away = {
        **os.environ,
        "PYTHONPATH": str(root),
        "LC_ALL": "C",
        "TZ": "Asia/Tokyo",
        "PYTHONHASHSEED": "9",
    }
    done = subprocess.run(
        command, cwd=tmp_path, env=away, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    with zipfile.ZipFile(file) as packed:
        assert (tmp_path / "again/phases.csv").read_bytes() == packed.read("phases.csv")
    example = root / "docs/examples/study/describe.py"
    said = subprocess.check_output([sys.executable, example, file], text=True)
    assert re.search(r"alone: ssd +short +n=4 mean=", said), said
    assert re.search(r"questions: trust +(long - short|short - long): n=4 mean=", said), said


def test_a_table_that_was_changed_by_hand_is_named(tmp_path: Path) -> None:
    data = pack(SMALL_PLAN, logs_of(small_plan(), 2))
    file = tmp_path / "study.zip"
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(file, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            new.writestr(name, content + b"x" if name == "phases.csv" else content)
    same, other = report(file, tmp_path / "out")
    assert (same, other) == ([], ["phases.csv"])


@pytest.mark.parametrize("fault", ["no zip", "damaged", "no plan", "strange name"])
def test_what_is_no_study_is_refused_with_a_sentence(tmp_path: Path, fault: str) -> None:
    file = tmp_path / "study.zip"
    if fault == "no zip":
        file.write_bytes(b"PK\x03\x04 and no more")
    elif fault == "damaged":
        data = bytearray(pack(SMALL_PLAN, {}))
        data[60:90] = bytes(range(225, 255))  # of the first file's packed bytes
        file.write_bytes(data)
    else:
        with zipfile.ZipFile(file, "w") as archive:
            if fault != "no plan":
                archive.writestr("plan.toml", SMALL_PLAN)
                archive.writestr("events/../../evil.csv", "")
    with pytest.raises(ConfigurationError, match=r"study\.zip"):
        report(file, tmp_path / "out")
    assert not (tmp_path / "evil.csv").exists()


def test_a_zip_that_was_packed_again_and_saved_by_a_spreadsheet_gives_the_same(
    tmp_path: Path,
) -> None:
    """With folders among its entries, and Windows' line ends and byte order marks in the logs."""
    data = pack(SMALL_PLAN, logs_of(small_plan(), 2))
    file = tmp_path / "study.zip"
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(file, "w") as new:
        new.mkdir("events")
        for name in old.namelist():
            content = old.read(name)
            if name.startswith("events/") or name == "plan.toml":
                content = b"\xef\xbb\xbf" + content.replace(b"\n", b"\r\n")
            new.writestr(name, content)
    assert report(file, tmp_path / "out")[1] == []
