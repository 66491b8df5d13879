"""The documents take the program's numbers from the program, so each number is in one place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from types import SimpleNamespace

import pytest

from tests.docs import values


def test_every_mark_of_a_number_is_closed_and_begins_no_line() -> None:
    """At the beginning of a line it would begin a block of HTML, and end the paragraph."""
    for page in values.pages():
        text = page.read_text("utf-8")
        assert not [line for line in text.splitlines() if line.startswith("<!--=")], page
        assert text.count("<!--=") == len(values.names(text)), f"not closed or misspelt: {page}"


def test_a_number_is_changed_in_one_place() -> None:
    sources: Mapping[str, object] = {
        "driver": SimpleNamespace(ACTION_TIMEOUT_S=0.7, SHARE=0.5, NAME="default-8")
    }
    mark = "<!--= driver.{} -->old<!--/-->".format
    text = mark("ACTION_TIMEOUT_S") + mark("ACTION_TIMEOUT_S ms") + mark("ACTION_TIMEOUT_S bare")
    changed = values.fill(text + mark("SHARE") + mark("NAME"), sources)
    assert [part.split("<")[0] for part in changed.split("-->")[1::2]] == [
        "0.7 s",
        "700 ms",
        "0.7",
        "0.5",
        "default-8",
    ]
    with pytest.raises(AttributeError, match="LOST_S"):
        values.fill(mark("LOST_S"))


def test_every_page_about_a_body_takes_the_dead_mans_time_from_the_code() -> None:
    bodies = ("any-robot", "ev3", "ev3-stock", "lego-education", "pybricks", "raspberry-pi", "ros")
    for name in (*(f"docs/howto/{body}" for body in (*bodies, "write-a-driver")), "SECURITY"):
        text = (values.ROOT / f"{name}.md").read_text("utf-8")
        assert "driver.ACTION_TIMEOUT_S" in values.names(text), name


def test_every_default_of_the_tables_is_the_programs() -> None:
    told = values.names((values.ROOT / "docs/reference/configuration.md").read_text("utf-8"))
    settings = {
        f"{table}.{field.name}"
        for table, source in values.SOURCES.items()
        if is_dataclass(source)
        for field in fields(source)
    }
    assert settings <= {*told} and "learner.nodes" in told


def test_the_documents_say_when_the_robot_may_try_and_when_it_is_ready() -> None:
    for name in ("tutorial.md", "howto/page.md"):
        told = values.names((values.ROOT / "docs" / name).read_text("utf-8"))
        assert {"lesson.TAUGHT_S", "trial_drive.CLEAN_S"} <= {*told}
