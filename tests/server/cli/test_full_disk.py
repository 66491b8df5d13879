"""Every command that writes: a full disk is reported in a sentence, and nothing is lost."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.server.conftest import Say


@pytest.mark.parametrize(
    "words",
    [
        "learn last --out m",
        "episodes compact last",
        "episodes title last x",
        "episodes export last --as folder",
        "episodes import OUT/mine --name again",
    ],
)
def test_a_full_disk_is_reported_in_a_sentence_and_nothing_is_lost(
    episode_id: str,
    data: Path,
    tmp_path: Path,
    words: str,
    monkeypatch: pytest.MonkeyPatch,
    say: Say,
) -> None:
    say(f"episodes export last --as folder --out {tmp_path}/mine")
    before = {path: path.read_bytes() for path in data.rglob("*.*") if path.is_file()}

    def refuse(self: object, *_: object) -> None:
        raise OSError(28, "No space left on device")

    for name in ("robot.store.folder.os.fsync", "robot.exchange.files._write"):
        monkeypatch.setattr(name, refuse)
    told = say(words.replace("OUT", str(tmp_path)), status=1)
    assert told.splitlines()[-1].endswith("No space left on device")
    assert "Traceback" not in told
    assert {path: path.read_bytes() for path in data.rglob("*.*") if path.is_file()} == before
