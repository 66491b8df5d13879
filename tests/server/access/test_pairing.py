"""Each browser has one session, and evicted sessions go by the rules."""

from urllib.parse import quote

import pytest

from server.access.pairing import _SESSIONS, Paired, Pairing
from server.bodies.eye_routes import EYE
from server.gateway.roles import Refusal, Role
from tests.kit.sizes import crossed

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
    f"http://h/pair#{TOKEN[:10]}\n{TOKEN[10:]}",  # the terminal's narrow window broke it
    *(" ".join(JOINED), "-".join(JOINED)),  # typed letter by letter
    "".join(chr(ord(letter) + 0xFEE0) for letter in JOINED),  # full width, as in Chinese
)
"""What a person has in hand: the token, its address, or lines of the terminal."""
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
def test_a_token_is_taken_in_every_form_that_a_person_has_in_hand_and_no_other(text):
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
    assert up != phone and pairing.find(phone) is None, "the terminal makes more of it"
    assert invited(pairing, up) == up, "an invitation makes no less of it"
    assert redeem(pairing, Role.VIEWER, up) != up and pairing.find(up) is None


@crossed(are_used=[False, True], times=[_SESSIONS + 2, 500])
def test_a_client_that_redeems_repeatedly_evicts_no_earlier_browser(times, are_used):
    pairing = Pairing(10)
    owner, eye, second = (redeem(pairing, role) for role in (Role.PILOT, EYE, Role.PILOT))
    pupil = invited(pairing)
    assert pairing.find(pupil) and pairing.find(second), "they load the page"
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
    for _ in range(_SESSIONS + 36):  # all of them come and are used
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
