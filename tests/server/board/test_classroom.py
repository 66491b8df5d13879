"""Who becomes a robot's teacher, and what its pupils may change afterwards."""

from __future__ import annotations

import json
import random
from collections.abc import Sequence
from pathlib import Path

import pytest

from robot.errors import ConfigurationError
from server.access.pairing import INVITATION_S, Paired, Pairing
from server.board.class_key import ClassKey, endpoint, keep_class_key, new_nonce, read_class_key
from server.board.classroom import LOCKS, Classroom
from server.gateway.roles import Refusal, Role
from tests.kit.sizes import seeds

KEY, OTHER = ClassKey("a" * 40), ClassKey("b" * 40)
HERE, THERE = "192.168.1.5:8000", "192.168.1.6:8000"


def test_a_board_with_the_key_gets_a_session_and_knows_the_robot() -> None:
    room, mine = Classroom(KEY), new_nonce()
    nonce, proof = room.challenge(mine, HERE, 10.0)
    assert KEY.accepts(proof, "robot", mine, nonce, HERE)
    secret = room.admit(mine, nonce, KEY.prove("board", mine, nonce, HERE), HERE, 10.1)
    assert secret and room.knows(f"Bearer {secret}")
    assert not room.knows(secret) and not room.knows("Bearer ") and not room.knows("")


@pytest.mark.parametrize("seed", seeds(8, 40))
def test_only_a_fresh_proof_of_the_same_handshake_is_admitted(seed: int) -> None:
    """Change one part of a valid handshake, chosen anew for each seed."""
    dice = random.Random(seed)
    room, mine, now_s = Classroom(KEY), new_nonce(), dice.uniform(0, 1e6)
    nonce, robot_proof = room.challenge(mine, HERE, now_s)
    good = {"board": mine, "nonce": nonce, "at": HERE, "key": KEY, "who": "board", "late_s": 1.0}
    wrong = {
        "board": [new_nonce(), "", mine.upper() + "x", mine + "\n"],
        "nonce": [nonce[:-1], nonce.replace(".", "", 1), "", room.challenge(mine, HERE, 0)[0]],
        "at": [THERE],
        "key": [OTHER],
        "who": ["robot", ""],
        "late_s": [10.5, 1e5],
    }
    field = dice.choice(list(wrong))
    bad = {**good, field: dice.choice(wrong[field])}
    proof = bad["key"].prove(bad["who"], str(bad["board"]), str(bad["nonce"]), bad["at"])
    at_s = now_s + bad["late_s"]
    assert room.admit(bad["board"], bad["nonce"], proof, HERE, at_s) is None, field
    assert room.admit(mine, nonce, robot_proof, HERE, now_s) is None, "its own proof, sent back"
    whole = KEY.prove("board", mine, nonce, HERE)
    assert room.admit(mine, nonce, whole, HERE, now_s + 1)
    assert room.admit(mine, nonce, whole, HERE, now_s + 1) is None, "it works once"


def test_endpoints_are_written_in_one_way() -> None:
    assert endpoint("::ffff:10.0.0.1", 80) == endpoint("10.0.0.1", 80)
    assert endpoint("FE80::1%eth0", 80) == endpoint("fe80::1", 80)


@pytest.mark.parametrize("text", ["", "short", "ä" * 40])
def test_an_invalid_key_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "key").write_text(text)
    with pytest.raises(ConfigurationError, match="class key"):
        read_class_key(tmp_path / "key")


def test_a_key_is_made_once_and_is_readable_only_by_its_owner(tmp_path: Path) -> None:
    file = tmp_path / "deep" / "class.key"
    assert keep_class_key(file) == keep_class_key(file)
    assert file.stat().st_mode & 0o077 == 0
    assert file.read_text().strip() not in repr(read_class_key(file))


@pytest.mark.parametrize("kept", [b"", b"{", b"[]", b"\xff", b'{"locks": 3}'])
def test_if_the_file_of_locks_is_damaged_everything_is_locked(tmp_path: Path, kept: bytes) -> None:
    (tmp_path / "class.json").write_bytes(kept)
    assert Classroom(KEY, tmp_path / "class.json").locks == set(LOCKS)


def test_locks_survive_a_restart(tmp_path: Path) -> None:
    file = tmp_path / "class.json"
    assert Classroom(KEY, file).locks == frozenset()
    Classroom(KEY, file).lock(["models", "gallery"])
    assert Classroom(KEY, file).locks == {"models", "gallery"}
    assert json.loads(file.read_text()) == {"locks": ["gallery", "models"]}


@pytest.mark.parametrize("names", [["doors"], ["models", ""], "models"])
def test_an_unknown_lock_is_refused_and_changes_nothing(names: Sequence[str]) -> None:
    room = Classroom(KEY)
    room.lock(["settings"])
    with pytest.raises(ConfigurationError, match="settings"):
        room.lock(names)
    assert room.locks == {"settings"}


def test_thirty_phones_pair_by_one_code_without_typing() -> None:
    pairing = Pairing(10)
    token, valid_s = pairing.invite(0.0)
    paired = [pairing.redeem(token, valid_s * i / 30, "10.0.0.7") for i in range(30)]
    assert all(isinstance(one, Paired) and one.role is Role.PILOT for one in paired)
    assert len({one.secret for one in paired if isinstance(one, Paired)}) == 30
    assert isinstance(pairing.redeem(token, INVITATION_S, ""), Refusal), "it does not last"


def test_a_saved_session_cannot_have_the_role_of_a_teacher(tmp_path: Path) -> None:
    file = tmp_path / "paired.json"
    file.write_text('{"sessions": [{"sha256": "00", "role": "teacher"}]}')
    assert Pairing(10, file)._sessions == {}
