"""Players have no cookie: a key in the address lets them watch, and do nothing else."""

import httpx
import pytest

from server.access.pairing import Pairing
from server.access.player_key import PlayerKey
from server.config import Config
from tests.server.virtual_server import WEB, VirtualServer

OTHER_SITE = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "no-cors", "accept": "image/*"}
PLAYER = {"accept": "*/*"}


@pytest.fixture
def server(tmp_path):
    config = Config(port=0, web=WEB, data=tmp_path)
    with VirtualServer(config, pairing=Pairing(1000), data=tmp_path) as made:
        yield made


def watch(server: VirtualServer, key: str, headers: dict[str, str]) -> httpx.Response:
    """Return the answer with the beginning of its stream, or with its refusal."""
    address = f"{server.address}/video.mjpg{key}"
    with httpx.Client() as client, client.stream("GET", address, headers=headers) as answer:
        if answer.status_code == 200:
            assert next(answer.iter_raw()).startswith(b"--frame")
        else:
            answer.read()
        return answer


def test_a_player_without_the_key_gets_advice_and_with_it_can_only_watch(server, tmp_path):
    refused = watch(server, "", PLAYER)
    assert refused.status_code == 401 and "drivelesson player-key" in refused.text
    assert watch(server, "?key=", PLAYER).status_code == 401, "there is no key yet"
    key = PlayerKey(tmp_path).replace()
    assert watch(server, f"?key={key}", PLAYER).status_code == 200
    assert watch(server, f"?key={key[:-1]}", PLAYER).status_code == 401
    for method, path in (
        *(("GET", "/"), ("GET", "/api/models"), ("GET", "/metrics"), ("POST", "/api/stop")),
        ("POST", "/video.mjpg"),
    ):
        answer = httpx.request(method, f"{server.address}{path}?key={key}", headers=PLAYER)
        assert answer.status_code in (401, 405), path
    PlayerKey(tmp_path).replace()
    assert watch(server, f"?key={key}", PLAYER).status_code == 401, "it was replaced"


def test_a_page_of_another_site_shows_the_picture_only_with_the_key(server, tmp_path):
    refused = watch(server, "", OTHER_SITE)
    assert refused.status_code == 403 and "drivelesson player-key" in refused.text
    key = f"?key={PlayerKey(tmp_path).replace()}"
    answer = watch(server, key, OTHER_SITE)
    assert answer.status_code == 200
    assert answer.headers["cross-origin-resource-policy"] == "cross-origin"
    assert answer.headers["access-control-allow-origin"] == "*"
    foreign = watch(server, key, {**OTHER_SITE, "host": "evil.example"})
    assert foreign.status_code == 421, "names are checked all the same"


def test_a_stream_ends_when_its_key_is_replaced(server, tmp_path):
    address = f"{server.address}/video.mjpg?key={PlayerKey(tmp_path).replace()}"
    with httpx.Client() as client, client.stream("GET", address, headers=PLAYER) as answer:
        for n_parts, _ in enumerate(answer.iter_raw()):
            if n_parts == 5:
                PlayerKey(tmp_path).remove()
            assert n_parts < 100, "it goes on"
    server.wait_until(lambda: server.hub.broadcast.video.viewers == 0)


def test_only_the_owner_can_read_the_key(tmp_path):
    key = PlayerKey(tmp_path)
    assert not key.accepts("") and key.read() == ""
    assert key.accepts(key.replace()) and not key.accepts("ä")
    assert (tmp_path / "player.key").stat().st_mode & 0o077 == 0
    key.remove()
    key.remove()
    assert not key.accepts("")
