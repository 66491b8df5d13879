"""A robot has a permanent name, and can be renamed."""

import httpx
import pytest

from robot.errors import ConfigurationError
from server.identity import COLOURS, NAMES, Identity, IdentityFile

from .virtual_server import VirtualServer


def test_a_robot_without_a_given_name_keeps_the_name_it_chose(tmp_path):
    first = IdentityFile(tmp_path).now
    assert first.name in NAMES
    assert {IdentityFile(tmp_path).now for _ in range(20)} == {first}


def test_a_name_given_at_the_start_is_kept(tmp_path):
    IdentityFile(tmp_path).change(colour="pink")
    assert IdentityFile(tmp_path, "Kitchen 3").now == Identity("Kitchen 3", "pink")
    assert IdentityFile(tmp_path).now == Identity("Kitchen 3", "pink")


@pytest.mark.parametrize("kept", [b"", b"[]", b"\xff", b'{"name": "x", "colour": "amber"}'])
def test_a_damaged_name_file_gives_the_robot_a_new_name(tmp_path, kept):
    (tmp_path / "robot.json").write_bytes(kept)
    assert IdentityFile(tmp_path).now.name in NAMES


@pytest.mark.parametrize("name", ["", " ", "a/b", "..", "x" * 25, "\ud83d", "a\nb", 3, None])
def test_an_invalid_name_is_refused_and_changes_nothing(tmp_path, name):
    identity = IdentityFile(tmp_path)
    before = identity.now
    with pytest.raises(ConfigurationError):
        identity.change(name=name)
    assert identity.now == IdentityFile(tmp_path).now == before


def test_clients_are_told_of_a_new_name():
    with (
        VirtualServer() as server,
        httpx.Client(base_url=server.address) as http,
        server.pilot() as present,
    ):
        assert http.get("/api/settings").json()["name"] == "bench"
        assert http.put("/api/settings", json={"name": "Ada", "colour": COLOURS[1]}).is_success
        told = present.wait_for(lambda m: m.get("name") == "renamed")
        assert (told["robot"], told["colour"]) == ("Ada", COLOURS[1])
        assert http.get("/api/settings").json()["name"] == "Ada"
        with server.pilot() as pilot:
            assert pilot.hello["robot"] == "Ada"


def test_an_event_reaches_present_clients_and_a_lasting_event_also_later_ones():
    VirtualServer().hub.broadcast.announce("nobody_listens")  # before the start
    with VirtualServer() as server:
        with server.pilot() as first:
            server.hub.broadcast.announce("model_saved", model="kitchen")
            server.hub.broadcast.announce("nothing_kept", detail="full")
            first.wait_for(lambda m: m.get("name") == "model_saved" and m["model"] == "kitchen")
            first.wait_for(lambda m: m.get("name") == "nothing_kept")
        with server.pilot() as second:
            second.wait_for(lambda m: m.get("name") == "nothing_kept" and m["detail"] == "full")
            assert not any(m.get("name") == "model_saved" for m in second.page.messages)
