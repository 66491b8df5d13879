"""Each browser has one session; a player has a key, with which it can only watch."""

from urllib.parse import quote

import httpx
import pytest

from server.access.pairing import _SESSIONS, Paired, Pairing
from server.access.player_key import PlayerKey
from server.bodies.eye_routes import EYE
from server.config import Config
from server.gateway.roles import Refusal, Role
from tests.kit.sizes import crossed
from tests.server.virtual_server import WEB, VirtualServer

TOKEN = "ABCD-EFGH-JKMN-PQRS"
JOINED = TOKEN.replace("-", "")
LINK = f"http://10.0.0.2:8000/pair#{TOKEN}"
FORMS = (
    *(TOKEN.lower(), JOINED, f"#{TOKEN}#", f"\ufeff{TOKEN}", f"pair#token={TOKEN}", f"<{TOKEN}>"),
    *(TOKEN.replace("-", mark) for mark in (" ", " - ", "–", "—", "‑", "−", "_", ".", ",", "/")),
    *(LINK, LINK.lower(), LINK.replace("#", "%23"), LINK.replace("#", "%2523"), f"{LINK}#top"),
    *(quote(LINK, safe=""), f"http://[fe80::1]:8000/pair#{TOKEN}", f"[Drive]({LINK})"),
    f"https://www.google.com/url?q=http%3A%2F%2F10.0.0.2%2Fpair%2523{TOKEN}&sa=D",
    *(f"  or open   {LINK} .", f"To pair another one that may drive: {TOKEN}\n\n"),
    f"  or open   {LINK}\n  To watch: http://10.0.0.2:8000/pair#VVVV-WWWW-XXXX-YYYY\n",
    f"\x1b[1m{LINK}\x1b[0m",
    f"http://h/pair#{TOKEN[:10]}\n{TOKEN[10:]}",  # a narrow terminal window broke the line
    *(" ".join(JOINED), "-".join(JOINED)),  # a person typed it letter by letter
    "".join(chr(ord(letter) + 0xFEE0) for letter in JOINED),  # full-width letters, as in Chinese
)
"""Texts that a person may paste: the token, its address, or lines of the terminal."""
WRONG = (
    *("", "##", TOKEN[:-5], f"{TOKEN[:-1]}T", f"0{TOKEN[1:]}", "http://10.0.0.2:8000"),
    *("x" * 5000, "%23" * 600, "\x00", "\ud800", "%ff%fe", "pair#\x1b["),
)


def redeem(pairing: Pairing, token: str | Role, before: str = "") -> str:
    """Redeem a token, or the terminal's token of a role; return the browser's secret."""
    token = pairing.tokens[token] if isinstance(token, Role) else token
    return pairing.redeem(token, 0.0, "", before).secret


def invited(pairing: Pairing, before: str = "") -> str:
    return redeem(pairing, pairing.invite(0.0)[0], before)


@pytest.mark.parametrize("text", [*FORMS, *WRONG], ids=lambda text: ascii(text)[:40])
def test_a_token_is_accepted_in_every_form_in_which_people_have_it(text):
    pairing = Pairing(10)
    pairing.tokens[Role.PILOT] = TOKEN
    paired = pairing.redeem(text, 0.0)
    if text in FORMS:
        assert isinstance(paired, Paired)
    else:
        assert isinstance(paired, Refusal) and paired.sentence


def test_redeeming_again_renews_the_session_that_a_browser_has():
    pairing = Pairing(10)
    phone = invited(pairing)
    assert invited(pairing, phone) == phone
    up = redeem(pairing, Role.PILOT, phone)
    assert up != phone and pairing.find(phone) is None, "the new role has a new session"
    assert invited(pairing, up) == up, "an invitation does not lower the role"
    assert redeem(pairing, Role.VIEWER, up) != up and pairing.find(up) is None


@crossed(are_used=[False, True], times=[_SESSIONS + 2, 500])
def test_a_client_that_redeems_repeatedly_evicts_no_earlier_browser(times, are_used):
    pairing = Pairing(10)
    owner, eye, second = (redeem(pairing, role) for role in (Role.PILOT, EYE, Role.PILOT))
    pupil = invited(pairing)
    assert pairing.find(pupil) and pairing.find(second), "both phones use their sessions"
    for _ in range(times):
        made = [invited(pairing), redeem(pairing, Role.PILOT), redeem(pairing, Role.VIEWER)]
        assert not are_used or all(map(pairing.find, made))
    assert all(map(pairing.find, (owner, second, eye, pupil)))


def test_a_connected_browser_stays_paired_and_the_owner_always_does(tmp_path):
    file = tmp_path / "paired.json"
    pairing = Pairing(10, file)
    owner, pilot = (redeem(pairing, Role.PILOT) for _ in range(2))
    session = pairing.find(pilot)
    pairing.is_in_use = lambda name: name == session.name
    for _ in range(_SESSIONS + 36):  # all of these browsers use their sessions again
        assert pairing.find(redeem(pairing, Role.PILOT))
    assert pairing.find(pilot)
    again = Pairing(10, file).find(owner)
    assert again is not None and Pairing(10, file).is_owner(again.name)
    pairing.is_in_use = lambda name: True
    refused = pairing.redeem(pairing.tokens[Role.PILOT], 0.0)
    assert isinstance(refused, Refusal) and refused.status == 503


def test_a_session_in_daily_use_survives_many_restarts(tmp_path):
    file = tmp_path / "paired.json"
    first = Pairing(10, file)
    _, daily, *others = (redeem(first, Role.PILOT) for _ in range(_SESSIONS + 1))
    assert all(map(first.find, others)) and first.find(daily)
    assert Pairing(10, file).find(daily)
    for _ in range(20):
        later = Pairing(10, file)
        assert later.find(redeem(later, Role.PILOT))
    assert Pairing(10, file).find(daily)


OTHER_SITE = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "no-cors", "accept": "image/*"}
PLAYER = {"accept": "*/*"}


@pytest.fixture
def server(tmp_path):
    config = Config(port=0, web=WEB, data=tmp_path)
    with VirtualServer(config, pairing=Pairing(1000), data=tmp_path) as made:
        yield made


def watch(server: VirtualServer, key: str, headers: dict[str, str]) -> httpx.Response:
    """Return the answer with the beginning of the stream, or with the refusal."""
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
    assert watch(server, "?key=", PLAYER).status_code == 401, "no key exists yet"
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
    assert watch(server, f"?key={key}", PLAYER).status_code == 401, "the key was replaced"


def test_a_page_of_another_site_shows_the_picture_only_with_the_key(server, tmp_path):
    refused = watch(server, "", OTHER_SITE)
    assert refused.status_code == 403 and "drivelesson player-key" in refused.text
    key = f"?key={PlayerKey(tmp_path).replace()}"
    answer = watch(server, key, OTHER_SITE)
    assert answer.status_code == 200
    assert answer.headers["cross-origin-resource-policy"] == "cross-origin"
    assert answer.headers["access-control-allow-origin"] == "*"
    foreign = watch(server, key, {**OTHER_SITE, "host": "evil.example"})
    assert foreign.status_code == 421, "the Host header is checked even with a key"


def test_a_stream_ends_when_its_key_is_replaced(server, tmp_path):
    address = f"{server.address}/video.mjpg?key={PlayerKey(tmp_path).replace()}"
    with httpx.Client() as client, client.stream("GET", address, headers=PLAYER) as answer:
        for n_parts, _ in enumerate(answer.iter_raw()):
            if n_parts == 5:
                PlayerKey(tmp_path).remove()
            assert n_parts < 100, "the stream has not ended"
    server.wait_until(lambda: server.hub.broadcast.video.viewers == 0)


def test_only_the_owner_can_read_the_key(tmp_path):
    key = PlayerKey(tmp_path)
    assert not key.accepts("") and key.read() == ""
    assert key.accepts(key.replace()) and not key.accepts("ä")
    assert (tmp_path / "player.key").stat().st_mode & 0o077 == 0
    key.remove()
    key.remove()
    assert not key.accepts("")
