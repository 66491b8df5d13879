"""Commands as a user types them, and their answers."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.__main__ import main


def say(words: str, capsys: pytest.CaptureFixture[str], status: int = 0) -> str:
    assert main(words.split()) == status
    captured = capsys.readouterr()
    return captured.out if status == 0 else captured.err


def assert_refused_by_a_full_disk(
    words: str, data: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Check a command while the disk cannot be written: it prints one sentence, and nothing is
    lost."""
    before = {path: path.read_bytes() for path in data.rglob("*.*") if path.is_file()}

    def refuse(self: object, *_: object) -> None:
        raise OSError(28, "No space left on device")

    for name in ("robot.store.folder.os.fsync", "robot.exchange.files._write"):
        monkeypatch.setattr(name, refuse)
    told = say(words, capsys, status=1)
    assert told.splitlines()[-1].endswith("No space left on device")
    assert "Traceback" not in told
    assert {path: path.read_bytes() for path in data.rglob("*.*") if path.is_file()} == before
