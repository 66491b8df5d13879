"""The list of robots that a teacher writes."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.board.discovery import read_list
from tests.server.cli.typed import say


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_list_of_robots_is_read_whatever_editor_wrote_it(
    tmp_path: Path, encoding: str, end: str
) -> None:
    file = tmp_path / "robots.txt"
    lines = (
        "kitchen.local:8000 # Müllers",
        "",
        "# the hall",
        "10.0.0.7:8001",
        "kitchen.local:8000",
    )
    file.write_bytes((end.join(lines) + end).encode(encoding))
    assert read_list(str(file)) == read_list("kitchen.local:8000,10.0.0.7:8001")


def test_a_missing_list_is_reported_in_one_clear_line(capsys: pytest.CaptureFixture[str]) -> None:
    told = say("board --robots /nowhere/robots.txt", capsys, status=2)
    assert "robots.txt: No such file" in told.splitlines()[-1]
