"""A robot's recordings are listed, shown, edited, deleted and restored over HTTP."""

import httpx
import pytest

from robot.types import Action, Mode, PilotCommand
from server.access.config import NetworkLimits
from server.config import Config
from server.recordings.part import Recordings
from tests.robot.recordings.drives import record_drive
from tests.server.live_robot import WEB
from tests.server.virtual_server import VirtualServer

Client = httpx.Client


@pytest.fixture
def server(tmp_path):
    config = Config(port=0, web=WEB, data=tmp_path, limits=NetworkLimits(requests_burst=5000))
    with VirtualServer(config, data=tmp_path, name="bench") as server:
        server.wait_until(lambda: server.rig.loop.state.frame_id is not None)
        yield server


@pytest.fixture
def client(server):
    with Client(base_url=server.address) as client:
        yield client


@pytest.fixture
def episode_id(server):
    return record_drive(server.persistence.storage.folder("episodes")).id


def test_a_drive_appears_in_the_list_while_it_is_recorded(server, client):
    loop, clock = server.rig.loop, server.clock
    assert client.get("/api/episodes").json()["episodes"] == []
    server.set_mode(Mode.TRAIN)
    for seq in range(40):
        frame_id = loop.state.frame_id
        loop.command(
            PilotCommand(held=Action.LEFT, frame_id=frame_id, seq=seq, received_s=clock.now_s())
        )
        server.forward(0.02)
    server.wait_until(lambda: client.get("/api/episodes").json()["recording"])
    server.wait_until(lambda: client.get("/api/episodes").json()["episodes"][0]["lessons"] > 5)
    listed = client.get("/api/episodes").json()
    [episode] = listed["episodes"]
    assert episode["recording"] and episode["id"] == listed["recording"]
    assert client.delete(f"/api/episodes/{episode['id']}").status_code == 409
    server.set_mode(Mode.STOPPED)
    server.persistence.stop()
    [episode] = client.get("/api/episodes").json()["episodes"]
    assert episode["damage"] is None and episode["lessons"] == loop.history.taught.total()


def test_an_episode_is_shown_with_timeline_and_pictures(client, episode_id):
    shown = client.get(f"/api/episodes/{episode_id}").json()
    assert shown["lessons"] == 60 and shown["moves"] == ["forward", "left", "right"]
    path = f"/api/episodes/{episode_id}/timeline"
    columns = client.get(path, params={"count": 5}).json()["columns"]
    assert len(columns["frame"]) == 5 and columns["frame"][-1] == shown["last_frame"]
    assert columns["label"][2] and columns["driven_by"][2] == "pilot"
    columns = client.get(path).json()["columns"]
    assert len(columns["frame"]) == len(columns["label"]) == shown["frames"]
    picture = client.get(f"/api/episodes/{episode_id}/frames/{shown['first_frame']}")
    assert picture.headers["content-type"] == "image/png"
    assert picture.content.startswith(b"\x89PNG")
    file = client.get(f"/api/episodes/{episode_id}/file")
    assert file.content.startswith(b"\x89MCAP0\r\n") and "attachment" in str(file.headers)


def test_a_recording_is_titled_edited_compacted_deleted_and_restored(server, client, episode_id):
    path = f"/api/episodes/{episode_id}"
    changed = client.patch(path, json={"title": "Hall", "protected": True}).json()
    assert (changed["title"], changed["protected"]) == ("Hall", True)
    first = client.get(path).json()["first_frame"]
    edits = [
        {"verb": "relabel", "first": first, "last": first + 9, "label": "right"},
        {"verb": "delete", "first": first + 20, "last": first + 29},
        {"verb": "trim", "first": first + 5, "last": first + 40},
    ]
    for number, edit in enumerate(edits, start=1):
        made = client.post(f"{path}/edits", json=edit)
        assert (made.status_code, len(made.json()["edit_list"])) == (201, number)
    columns = client.get(f"{path}/timeline").json()["columns"]
    assert columns["deleted"][:5] == [True] * 5 and columns["deleted"][20:30] == [True] * 10
    assert columns["label"][:10] == ["right"] * 10
    for left in (2, 1, 0):
        assert len(client.delete(f"{path}/edits/last").json()["edit_list"]) == left
    assert client.delete(f"{path}/edits/last").status_code == 409
    client.post(f"{path}/edits", json=edits[2])
    assert client.post(f"{path}/compact").json()["undo"]
    assert client.get(path).json()["first_frame"] == first + 5
    assert client.delete(path).status_code == 409, "the recording is protected"
    client.patch(path, json={"protected": False})
    undo = client.delete(path).json()["undo"]
    assert client.get(path).status_code == 404
    assert client.post("/api/episodes/restore", json={"undo": undo}).json()["id"] == episode_id
    assert client.get("/api/episodes").json()["offered"] == []
    server.persistence.part(Recordings).episodes.budget_bytes = 0
    assert client.get("/api/episodes").json()["offered"] == [episode_id]


def test_each_refusal_has_its_status(client, episode_id):
    """tests/server/test_hostile_values.py tests other invalid values."""
    for method, path, body, status in (
        ("GET", "/nobody", None, 404),
        ("GET", ".zip?episode=nobody", None, 404),
        ("GET", "/ID/frames/99999", None, 422),
        ("POST", "/ID/edits", {"verb": "paint", "first": 1, "last": 2}, 400),
        ("POST", "/ID/edits", {"verb": "delete", "first": 9, "last": 2}, 409),
        ("POST", "/ID/edits", {"verb": "relabel", "first": 1, "last": 2, "label": "fly"}, 409),
        ("POST", "/delete", {"episodes": ["nobody"]}, 404),
    ):
        address = "/api/episodes" + path.replace("ID", episode_id)
        answer = client.request(method, address, json=body)
        assert answer.status_code == status, (path, answer.text)
