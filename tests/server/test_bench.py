"""The benchmark itself, in small: its figures are there and sane; their size is for the big run."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from server.__main__ import main


@pytest.mark.slow
def test_bench_link_measures_all_servers(tmp_path: Path) -> None:
    pytest.importorskip("websockets.asyncio.client", reason="Debian 12's websockets has it not")
    file = tmp_path / "link.json"
    words = ["bench", "link", "--viewers", "2", "--seconds", "0.7", "--slow-seconds", "2"]
    assert main([*words, "--json", str(file)]) == 0
    result = json.loads(file.read_text())
    assert [row["server"] for row in result["servers"]] == [
        "drivelesson",
        "naive-websocket",
        "plain-websocket",
        "naive-mjpeg",
    ]
    ours = result["servers"][0]
    assert ours["frames_per_second"] > 20 and ours["loop_hz"] > 20
    assert ours["latency_ms"]["p50"] < 20
    assert ours["serving_cpu_share_idle_after"] < 0.05
    assert result["commands"]["wire_to_drive_ms"]["p95"] < 1.5 * result["commands"]["cycle_ms"]
    small, large = result["slow"]
    # Two seconds on a busy machine: the limits of 250 and 1200 ms are for the full run.
    assert small["slow_age_ms"]["p50"] < 300 and large["slow_age_ms"]["p50"] < 1500


def test_an_unknown_benchmark_is_refused() -> None:
    with pytest.raises(SystemExit) as ended:
        main(["bench", "nothing"])
    assert ended.value.code == 2


def test_viewers_must_be_numbers(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "link", "--viewers", "many"]) == 1
    assert "--viewers" in capsys.readouterr().err
