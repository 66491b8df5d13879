"""Stored studies survive damaged logs and withdrawals, and `drivelesson study` reads them."""

import errno
import unicodedata
from pathlib import Path

import pytest

from robot.errors import ConfigurationError
from robot.store.folder import Storage
from robot.study.events import StudyEvent, read_events, write_events
from robot.study.plan import parse_plan
from robot.testing import VirtualClock
from server.cli.main import main
from server.study.erasing import erase
from server.study.event_log import EventLog
from server.study.extension import StudyExtension
from server.study.folder import StudyFolder
from tests.server.study.sessions import PLAN, begin, drive, post, refused, rows, session, take_part
from tests.server.test_teaching_routes import ask


def test_a_withdrawn_participant_leaves_nothing_and_frees_the_place(server, tmp_path):
    pilot = server.pilot()
    pilot.mode("train")
    pilot.hold("forward")
    server.forward(2.0)
    pilot.close()
    server.forward(12.0)
    own = {e["id"] for e in ask(server, "GET", "/api/episodes").json()["episodes"]}
    take_part(server, "P01")
    server.forward(11.0)
    begin(server, "P02")
    ask(server, "DELETE", "/api/session")
    assert "all 2 places" in refused(server, "/api/session", study="walk", participant="P03")
    kept = list((tmp_path / "studies/walk").rglob("P01*"))
    assert len(kept) == 3, "the session has a log and two models"
    driven = {id for row in rows(server) for id in row["recordings"].split()}
    assert len(driven) >= 2 and own and not own & driven
    gone = ask(server, "DELETE", f"/api/episodes/{min(driven)}")
    assert gone.status_code == 200, "one of the recordings is now in the trash"
    answer = ask(server, "DELETE", "/api/studies/walk/sessions/P01")
    assert answer.status_code == 200, answer.text
    deleted = answer.json()["deleted"]
    recordings = {Path(path).stem for path in deleted if path.endswith(".mcap")}
    assert recordings == driven
    assert any(path.startswith("trash/") and path.endswith(".mcap") for path in deleted)
    assert {"studies/walk/P01.csv", "studies/walk/models/P01-1.npz"} < set(deleted)
    assert not [path for path in deleted if (tmp_path / path).exists()]
    assert not list(tmp_path.rglob("*P01*"))
    for path in filter(Path.is_file, (tmp_path / "episodes").rglob("*")):
        assert not [id for id in driven if id in str(path) or id.encode() in path.read_bytes()]
    left = {e["id"] for e in ask(server, "GET", "/api/episodes").json()["episodes"]}
    assert own <= left and not driven & left
    begin(server, "P03")
    assert session(server)["of"] == 2
    listed = ask(server, "GET", "/api/studies/walk").json()["sessions"]
    assert {s["participant"]: s["order"][0] for s in listed} == {"P02": "long", "P03": "short"}


def test_a_session_that_is_still_recorded_is_not_withdrawn(server, tmp_path):
    begin(server)
    post(server, "/api/session/drive", confirmed=True)
    drive(server, 1.0)
    ask(server, "DELETE", "/api/session")
    conductor = server.services.extension(StudyExtension).conductor
    (recording,) = {
        e.value for e in conductor.folder.events("walk", "P01") if e.event == "recording"
    }
    with pytest.raises(ConfigurationError, match="still being recorded"):
        conductor.folder.withdraw("walk", "P01", recording)
    assert (tmp_path / "studies/walk/P01.csv").exists()


def test_a_damaged_log_is_reported_and_affects_no_other_session(server, tmp_path):
    begin(server, "P01")
    ask(server, "DELETE", "/api/session")
    (tmp_path / "studies/walk/P02.csv").write_bytes(b"\xff\xfe\n\n")
    listed = ask(server, "GET", "/api/studies/walk").json()["sessions"]
    assert [bool(s["fault"]) for s in listed] == [False, True]
    answer = ask(server, "POST", "/api/session", json={"study": "walk", "participant": "P02"})
    assert answer.status_code == 422 and "P02.csv" in answer.json()["detail"]
    begin(server, "P01")


def test_a_withdrawn_code_that_is_used_again_is_listed_with_the_new_data(tmp_path):
    """Only the content of the logs differs, not their length."""
    folder = StudyFolder(Storage(tmp_path))
    folder.create("walk", PLAN)
    for slot, at_s in ((0, 1000.0), (1, 2000.0)):
        event = StudyEvent(wall_s=at_s, event="session_begun", position=1, value=str(slot))
        folder.log_path("walk", "P01").write_text(write_events([event], with_head=True))
        [found] = folder.summaries("walk")
        assert (found.slot, found.began_at_s) == (slot, at_s)
        folder.withdraw("walk", "P01", None)


@pytest.mark.parametrize("there", ["Caf\u00e9", "CAFE\u0301"])
def test_a_name_that_the_file_system_considers_equal_counts_as_taken(there, tmp_path):
    folder = StudyFolder(Storage(tmp_path))
    folder.create(there, PLAN)
    for name in ("Caf\u00e9", "Cafe\u0301", " CAF\u00c9 "):
        with pytest.raises(ConfigurationError, match="there is already a study"):
            folder.create(name, PLAN)
    assert folder.create("Cafe", PLAN) == "Cafe"


@pytest.mark.parametrize("form", ["NFC", "NFD"])
def test_data_is_erased_in_every_encoding_of_its_names_accents(tmp_path, form):
    storage, name = Storage(tmp_path), unicodedata.normalize(form, "Zoé")
    for entry in (f"{name}.mcap", f"{name}-2.edits.json", f"{name}e.mcap"):
        (storage.folder("episodes") / entry).touch()
    storage.discard(storage.folder("episodes") / f"{name}-2.edits.json")
    assert len(erase(storage, ["Zoé"])) == 2
    assert [path.name for path in storage.folder("episodes").iterdir()] == [f"{name}e.mcap"]


def test_an_incomplete_line_is_cut_off_when_the_disk_is_full(tmp_path):
    resource = pytest.importorskip("resource")
    path = tmp_path / "P01.csv"
    whole = write_events([StudyEvent(wall_s=1.0, event="left")] * 3, with_head=True)
    path.write_text(whole + "2.0,le")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (16, limits[1]))
    try:
        log = EventLog(path, VirtualClock())
        log.start()
        log.stop()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert len(read_events(path.read_bytes())) == 3


def test_an_event_whose_write_failed_is_not_written_twice(tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError(errno.EIO, "Input/output error")

    path = tmp_path / "studies" / "P01.csv"
    log = EventLog(path, VirtualClock())
    log.start()  # a new log needs its folder and a header line
    for n in range(3):
        log.note([StudyEvent(wall_s=float(n), event="left")])
        with monkeypatch.context() as patch:
            patch.setattr("os.fsync", refuse)
            patch.setattr("os.truncate", refuse)
            with pytest.raises(OSError, match="Input/output"):
                log.flush()
    log.flush()
    log.stop()
    assert [event.wall_s for event in read_events(path.read_bytes())] == [0.0, 1.0, 2.0]


@pytest.mark.parametrize("name", ["trust", "participant"])
def test_a_question_with_the_name_of_another_column_is_refused_in_a_new_plan(
    tmp_path, capsys, name
):
    """In an earlier version, the answers to such a question replaced the column's own content."""
    text = f'{PLAN}[[question]]\nname = "{name}"\ntext = "Well?"\n'
    plan = tmp_path / "plan.toml"
    plan.write_text(text)
    assert main(["study", "check", str(plan)]) == 2
    said = (
        f"plan.toml: the name '{name}' is used for two phases.csv columns; give each its own name"
    )
    assert said in capsys.readouterr().err
    with pytest.raises(
        ConfigurationError, match=f"the name '{name}' is used for two phases.csv columns"
    ):
        StudyFolder(Storage(tmp_path)).create("walk", text)
    assert name in {question.name for question in parse_plan(text).questions}, "old plans work"
