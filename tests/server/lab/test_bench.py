"""The benchmark in a small size: it measures and prints, and judges no time."""

import json
import threading
from multiprocessing.connection import Connection

import pytest

from robot.errors import ConfigurationError
from robot.policy import autosize
from server.__main__ import main
from server.lab.bench import link, subject
from server.lab.bench.report import TOO_BUSY, in_turns, percentiles
from server.lab.bench.subject import ServerUnderTest
from tests.kit.sizes import IS_FULL


@pytest.mark.slow
@pytest.mark.realtime
def test_bench_link_measures_viewers_and_commands(tmp_path, monkeypatch, capsys):
    pytest.importorskip("websockets.asyncio.client", reason="Debian 12's websockets has it not")
    monkeypatch.setattr(link, "_SETTLE_S", 0.05)  # figures that are not judged need no pause
    monkeypatch.setattr(link, "_COMMANDS", 8)
    monkeypatch.setattr(link, "_COMMAND_EVERY_S", 0.1)
    file = tmp_path / "link.json"
    # Long enough for a busy machine to send some pictures.
    words = ["bench", "link", "--viewers", "2", "--seconds", "3", "--turns", "1"]
    assert main([*words, "--json", str(file)]) == 0
    result = json.loads(file.read_text())
    [ours] = result["viewers"]
    assert ours["frames_per_second"] > 0 and ours["loop_hz"] > 0
    for figures in (ours["latency_ms"], result["commands"]["wire_to_drive_ms"]):
        assert 0 < figures["p50"] <= figures["p95"]
    assert 0 <= ours["serving_cpu_share_idle_after"] < 1
    assert ours["beside_plain"]["own"] > 0 and ours["beside_plain"]["peer"] > 0
    if IS_FULL:
        check_bench_crowd_measures_both_sides(capsys)


def check_bench_crowd_measures_both_sides(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["bench", "crowd", "--greedy", "2", "--viewers", "3", "--seconds", "0.5", "--json"]
    capsys.readouterr()
    assert main(words) == 0
    result = json.loads(capsys.readouterr().out)
    for side in ("without", "with"):
        assert 0 < result["greedy"][side]["p50"] <= result["greedy"][side]["p99"]
    assert result["greedy"]["ratio"] > 0 and result["watched"]["slowest_hz"] > 0


def test_figures_that_were_not_measured_are_said_to_be_missing():
    names = "viewers frames_per_second process_cpu_us_per_frame loop_hz late_cycles"
    none = percentiles([])
    row = dict.fromkeys(names.split(), 0.0) | {"cpu_us_per_frame": None, "latency_ms": none}
    text = link._table({"viewers": [row], "commands": {"wire_to_drive_ms": none}}).as_text()
    assert TOO_BUSY in text and "nan" not in text and "None" not in text


def test_the_ratio_is_that_of_a_turn_in_the_middle_unless_they_differ_too_much():
    found = in_turns([2.0, 30.0, 4.0], [4.0, 50.0, 10.0])
    assert (found["ratio"], found["spread"]) == (0.5, 0.2)
    assert (found["own"], found["peer"], found["turns"]) == (4.0, 10.0, 3)
    assert in_turns([1.0, 1.0, 2.1], [1.0, 1.0, 1.0])["ratio"] is None
    assert in_turns([1.0, 1.0, 1.9], [1.0, 1.0, 1.0])["ratio"] == 1.0


def serve_for_ever(line: Connection, kind: str, rate_hz: float) -> None:
    """Stay alive although the pipe is closed."""
    line.send(8080)
    threading.Event().wait()


def test_a_server_that_does_not_end_is_killed_and_this_is_reported(monkeypatch):
    monkeypatch.setattr(subject, "_serve", serve_for_ever)
    served = ServerUnderTest("drivelesson", 30.0)
    with pytest.raises(ConfigurationError, match="had not ended after 60 s"), served:
        monkeypatch.setattr(served._process, "join", lambda patience_s: None)
    monkeypatch.undo()
    served._process.join()
    assert served._process.exitcode, "it was killed"


def test_bench_learner_writes_figures_for_every_size(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(autosize, "SIZES", (2, 8))
    out = tmp_path / "bench.json"
    assert main(["bench", "learner", "--json", str(out)]) == 0
    result = json.loads(out.read_text())
    assert [row["max_nodes"] for row in result["policies"]] == [2, 8]
    assert all(row["learn_p99_us"] >= row["learn_us"] > 0 for row in result["policies"])
    for row in result["cluster"]["sizes"]:
        assert row["train_per_product"] == pytest.approx(row["train_us"] / row["product_us"])
    assert "frames/s" in capsys.readouterr().out
