"""`drivelesson episodes play`, as a user types it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from ..cli.typed import say

PLAY = [sys.executable, "-m", "server", "episodes", "play"]


@pytest.mark.slow
def test_a_recording_is_played_into_a_page(episode_id: str, data: Path) -> None:
    words = [*PLAY, episode_id, "--port", "0", "--data", str(data)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as playing:
        try:
            assert playing.stdout is not None
            assert any("Drivelesson is ready: open http" in line for line in playing.stdout)
        finally:
            playing.terminate()


def test_a_file_that_is_not_a_recording_is_reported(data: Path, tmp_path: Path) -> None:
    (tmp_path / "broken.mcap").write_bytes(b"no recording")
    words = [*PLAY, str(tmp_path / "broken.mcap"), "--port", "0", "--data", str(data)]
    played = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (played.returncode, played.stdout) == (2, "")
    assert (
        played.stderr.splitlines()[-1]
        == "drivelesson: broken.mcap cannot be read: broken.mcap is not an MCAP file"
    )


def test_an_unknown_name_is_reported(episode_id: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert "no episode of this name" in say("episodes play nobody", capsys, status=2)
