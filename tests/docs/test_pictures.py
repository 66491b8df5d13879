"""Each picture of the docs is shown somewhere, and what is drawn agrees with code and results."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import pytest

from robot.bodies.gpio.driver import GpioOptions
from robot.bodies.ros.camera import RosCameraOptions
from robot.bodies.ros.driver import RosOptions

DOCS = Path(__file__).resolve().parents[2] / "docs"
IMAGES = DOCS / "images"
_SHOWN = re.compile(r"""(?:src="|\]\()([^")\s]*images/[^")\s]+)""")


def test_every_picture_is_shown_and_every_shown_picture_exists() -> None:
    shown = {
        (page.parent / name).resolve()
        for page in (DOCS.parent / "README.md", *DOCS.rglob("*.md"))
        for name in _SHOWN.findall(page.read_text("utf-8"))
    }
    kept = set(IMAGES.iterdir())
    assert shown == kept, f"{len(kept - shown)} are not shown, {len(shown - kept)} are missing"
    assert sum(path.stat().st_size for path in kept) < 5_000_000, "pictures stay small"
    film = IMAGES / "ten-seconds.webp"
    assert film in shown and film.stat().st_size < 2_000_000


def test_the_drawn_terminals_are_those_of_the_code() -> None:
    def drawn(name: str, wanted: str) -> list[str]:
        texts = re.findall(r">([^<>]+)</text>", (IMAGES / f"wiring-{name}.svg").read_text("utf-8"))
        return [found[1] for text in texts if (found := re.fullmatch(wanted, text))]

    hub = (DOCS / "examples/firmware/hub.py").read_text("utf-8")
    left, right, eyes, bumper = re.findall(r"\bPort\.([A-F])\b", hub)
    assert drawn("pybricks", "port (.)") == [left, eyes, right, bumper]
    pins = GpioOptions().settings()["motor_pins"]
    assert drawn("gpio", r"GPIO (\d+) .*") == [str(pin) for side in pins for pin in side]
    firmware = (DOCS / "examples/firmware/robot.py").read_text("utf-8")
    [numbers] = re.findall(r"^PINS = \((.*?)\)", firmware, re.MULTILINE)
    assert drawn("esp32", r"pin (\d+)") == numbers.split(", ")
    topics = [RosOptions().cmd_vel_topic, RosCameraOptions().image_topic, "/drivelesson/advice"]
    assert drawn("ros", "(/.+)") == topics


@pytest.mark.parametrize(
    ("column", "colour"),
    [("published-32", "#8a8f98"), ("default-32", "#1769d2"), ("the teacher himself", "#e08a00")],
)
def test_the_figure_shows_the_measured_distances(column: str, colour: str) -> None:
    data = json.loads((DOCS / "results/1-retraining.json").read_text("utf-8"))
    at = data["columns"].index(column)
    trials = [row for row in data["rows"] if row["what"].startswith("trial ")]
    measured = [row["measured"][at].partition(" ")[0] for row in trials]
    figure = (IMAGES / "retraining.svg").read_text("utf-8")
    dots = re.findall(rf'<circle cx="([\d.]+)" .* fill="{colour}"/>\n<text .*>(.+)</text>', figure)
    assert [text for _, text in dots[1:]] == measured, "the first one is in the legend"
    for x, text in dots[1:]:
        share = math.log10(float(text) / 0.01) / 3  # from 0.01 to 10
        assert float(x) == pytest.approx(170 + share * 450, abs=0.1)
