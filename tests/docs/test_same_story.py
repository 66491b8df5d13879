"""The documents tell the numbers by which the robot judges whether it is ready."""

from __future__ import annotations

from pathlib import Path

import pytest

from robot.control.readiness import CLEAN_S, STARTS, TAUGHT_S

DOCS = Path(__file__).resolve().parents[2] / "docs"


@pytest.mark.parametrize("name", ["tutorial.md", "howto/page.md"])
def test_the_documents_tell_when_it_may_try_and_when_it_is_ready(name: str) -> None:
    text = (DOCS / name).read_text("utf-8")
    assert f"{TAUGHT_S:.0f} s of teaching" in text
    assert f"{CLEAN_S:.0f} s " in text
    assert STARTS == 3 and "three t" in text
