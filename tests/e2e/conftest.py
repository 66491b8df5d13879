from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from .world import DESKTOP, PHONE, World, open_page, running_chromium, running_world


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Be patient: what is waited for is an event, and a busy machine is no fault."""
    for item in items:
        if Path(__file__).parent in item.path.parents and not item.get_closest_marker("timeout"):
            item.add_marker(pytest.mark.timeout(300))


@pytest.fixture(scope="package")
def chromium() -> Iterator[Any]:
    with running_chromium() as browser:
        yield browser


@pytest.fixture
def frame_rate_hz() -> float:
    """Pictures a second; a file whose tests must teach much first overrides it with more."""
    return 10.0


@pytest.fixture
def world(request: pytest.FixtureRequest, tmp_path: Path, frame_rate_hz: float) -> Iterator[World]:
    """A robot in the office, or in the world that the test names."""
    place = getattr(request, "param", "office")
    with running_world(tmp_path, world=place, frame_rate_hz=frame_rate_hz) as running:
        yield running


@pytest.fixture
def phone(chromium: Any, world: World) -> Iterator[Any]:
    """The page on a phone."""
    context = chromium.new_context(viewport=PHONE, has_touch=True, is_mobile=True)
    yield open_page(context, world.address)
    context.close()


@pytest.fixture
def desktop(chromium: Any, world: World) -> Iterator[Any]:
    """The page on a computer with a mouse."""
    context = chromium.new_context(viewport=DESKTOP)
    yield open_page(context, world.address)
    context.close()
