"""The files for Prometheus, Grafana and Foxglove use existing names."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from robot.recordings.messages import SCHEMAS, Topic
from robot.types import StopReason
from tests.conformance.samples import metrics_of_a_robot

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
_NAME = re.compile(r"\bdrivelesson_\w+")


@pytest.fixture(scope="module")
def names() -> set[str]:
    """The names in the `/metrics` of a robot that has all metrics."""
    text = metrics_of_a_robot()
    # this metric exists only after the robot has learned
    return {*_NAME.findall(text), "drivelesson_learner_seconds_sum"}


@pytest.mark.parametrize("file", ["dashboard.json", "alerts.yml"])
def test_every_queried_metric_exists(file: str, names: set[str]) -> None:
    asked = set(_NAME.findall((EXAMPLES / "monitoring" / file).read_text("utf-8")))
    assert len(asked) > 5
    assert asked <= names


def test_every_stop_reason_in_an_alert_exists() -> None:
    alerts = (EXAMPLES / "monitoring/alerts.yml").read_text("utf-8")
    [reasons] = re.findall(r'reason=~"([\w|]+)"', alerts)
    assert set(reasons.split("|")) <= {*StopReason}


def test_the_layout_shows_topics_and_fields_that_recordings_have() -> None:
    layout = json.loads((EXAMPLES / "foxglove/layout.json").read_text("utf-8"))
    panels = layout["configById"].values()
    paths = [line["value"] for panel in panels for line in panel.get("paths", ())]
    assert len(paths) > 5
    for path in paths:
        topic, _, name = path.partition(".")
        assert name in SCHEMAS[topic]["properties"], path
    topics = [topic for panel in panels for topic in panel.get("topics", ())]
    topics += [panel["imageMode"]["imageTopic"] for panel in panels if "imageMode" in panel]
    assert {*topics} <= {*Topic}
