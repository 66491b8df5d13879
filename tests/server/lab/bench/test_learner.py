from __future__ import annotations

import json

import pytest

from robot.policy import autosize
from server.__main__ import main


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(autosize, "SIZES", (2, 8))


def test_writes_figures_for_every_size(tmp_path, capsys):
    out = tmp_path / "bench.json"
    assert main(["bench", "learner", "--json", str(out)]) == 0
    result = json.loads(out.read_text())
    assert [row["max_nodes"] for row in result["policies"]] == [2, 8]
    assert all(row["learn_p99_us"] >= row["learn_us"] > 0 for row in result["policies"])
    for row in result["cluster"]["sizes"]:
        assert row["train_per_product"] == pytest.approx(row["train_us"] / row["product_us"])
    assert "frames/s" in capsys.readouterr().out


def test_an_unknown_learner_is_one_clear_line(capsys):
    assert main(["bench", "learner", "--learner", "nobody"]) == 2
    assert "default-NUMBER" in capsys.readouterr().err
