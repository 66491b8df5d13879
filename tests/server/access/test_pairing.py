"""Each browser has one session, and evicted sessions go by the rules."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote

from server.access.pairing import _SESSIONS, Paired, Pairing
from server.bodies.eye_routes import EYE
from server.gateway.roles import Refusal, Role
from tests.kit.sizes import crossed


def redeem(pairing: Pairing, token: str, before: str = "") -> str:
    paired = pairing.redeem(token, 0.0, "", before)
    assert isinstance(paired, Paired)
    return paired.secret


def invited(pairing: Pairing, before: str = "") -> str:
    return redeem(pairing, pairing.invite(0.0)[0], before)


def forms(token: str) -> Iterator[str]:
    """Yield what a person has in hand: the token, its address, or lines of the terminal."""
    joined = token.replace("-", "")
    texts = [token, token.lower(), joined, f"#{token}#", f"\ufeff{token}", f"pair#token={token}"]
    texts += [
        token.replace("-", mark)
        for mark in (" ", " - ", "–", "—", "‑", "−", "_", ".", ",", "/", ":")
    ]
    for page in ("http://10.0.0.2:8000/pair", "https://drivelesson.local/robot/pair", "pair", ""):
        texts += [f"{page}#{token}", f"{page}#{joined.lower()}", f"{page}%23{token}"]
        texts += [f"{page}%2523{token}", f"{page}#{token}#top", quote(f"{page}#{token}", safe="")]
    texts.append(f"https://www.google.com/url?q=http%3A%2F%2F10.0.0.2%2Fpair%2523{token}&sa=D")
    texts.append(f"http://[fe80::1]:8000/pair#{token}")
    for text in texts:
        yield from (text, f"  or open   {text}", f"To watch: {text}", f"{text} .", f"<{text}>")
        yield f"To pair another one that may drive: {text}\n\n"
        yield f"\x1b[1m{text}\x1b[0m"
    other = "http://10.0.0.2:8000/pair#VVVV-WWWW-XXXX-YYYY"
    yield f"  or open   http://h/pair#{token}\n  at one of http://10.0.0.2\n  To watch: {other}\n"
    yield f"[Drive](http://h/pair#{token})"
    yield f"http://h/pair#{token[:10]}\n{token[10:]}"  # the terminal's narrow window broke it
    yield " ".join(joined)  # typed letter by letter
    yield "-".join(joined)
    yield "".join(chr(ord(letter) + 0xFEE0) for letter in joined)  # full width, as in Chinese


def test_a_token_is_taken_in_every_form_that_a_person_has_in_hand() -> None:
    pairing = Pairing(10)
    every = list(forms("ABCD-EFGH-JKMN-PQRS"))
    assert len(every) >= 200
    for form in every:
        pairing.tokens[Role.PILOT] = "ABCD-EFGH-JKMN-PQRS"
        assert isinstance(pairing.redeem(form, 0.0), Paired), form
    for wrong in (
        *("", "#", "##", "ABCD-EFGH-JKMN", "#ABCD-EFGH-JKMN-PQRT", "x" * 5000, "%23" * 600),
        *("http://10.0.0.2:8000", "0BCD-EFGH-JKMN-PQRS", "\x00", "\ud800", "%ff%fe", "pair#\x1b["),
    ):
        pairing.tokens[Role.PILOT] = "ABCD-EFGH-JKMN-PQRS"
        refused = pairing.redeem(wrong, 0.0)
        assert isinstance(refused, Refusal) and refused.sentence, wrong


def test_redeeming_again_renews_the_session_that_a_browser_has() -> None:
    pairing = Pairing(10)
    phone = invited(pairing)
    assert invited(pairing, phone) == phone
    up = redeem(pairing, pairing.tokens[Role.PILOT], phone)
    assert up != phone and pairing.find(phone) is None, "the terminal makes more of it"
    assert invited(pairing, up) == up, "an invitation makes no less of it"
    assert redeem(pairing, pairing.tokens[Role.VIEWER], up) != up and pairing.find(up) is None


@crossed(are_used=[False, True], times=[_SESSIONS + 2, 500])
def test_a_client_that_redeems_repeatedly_evicts_no_earlier_browser(
    times: int, are_used: bool
) -> None:
    pairing = Pairing(10)
    owner, eye = (redeem(pairing, pairing.tokens[role]) for role in (Role.PILOT, EYE))
    second, pupil = redeem(pairing, pairing.tokens[Role.PILOT]), invited(pairing)
    assert pairing.find(pupil) and pairing.find(second), "they load the page"
    for _ in range(times):
        made = [invited(pairing)]
        made += [redeem(pairing, pairing.tokens[role]) for role in (Role.PILOT, Role.VIEWER)]
        assert not are_used or all(map(pairing.find, made))
    assert all(map(pairing.find, (owner, second, eye, pupil)))


def test_a_connected_browser_stays_paired_and_the_owner_always_does(tmp_path: Path) -> None:
    file = tmp_path / "paired.json"
    pairing = Pairing(10, file)
    owner, pilot = (redeem(pairing, pairing.tokens[Role.PILOT]) for _ in range(2))
    session = pairing.find(pilot)
    assert session is not None
    pairing.is_in_use = lambda name: name == session.name
    for _ in range(_SESSIONS + 36):  # all of them come and are used
        assert pairing.find(redeem(pairing, pairing.tokens[Role.PILOT]))
    assert pairing.find(pilot)
    again = Pairing(10, file).find(owner)
    assert again is not None and Pairing(10, file).is_owner(again.name)
    pairing.is_in_use = lambda name: True
    refused = pairing.redeem(pairing.tokens[Role.PILOT], 0.0)
    assert isinstance(refused, Refusal) and refused.status == 503


def test_a_session_in_daily_use_survives_many_restarts(tmp_path: Path) -> None:
    file = tmp_path / "paired.json"
    first = Pairing(10, file)
    redeem(first, first.tokens[Role.PILOT])  # the owner
    daily, *others = (redeem(first, first.tokens[Role.PILOT]) for _ in range(_SESSIONS))
    assert all(map(first.find, others)) and first.find(daily)
    second = Pairing(10, file)
    assert second.find(daily)
    for _ in range(20):
        third = Pairing(10, file)
        assert third.find(redeem(third, third.tokens[Role.PILOT]))
    assert Pairing(10, file).find(daily)
