from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from .world import DESKTOP, PHONE, World, open_page, running_chromium, running_world


@pytest.fixture(scope="package")
def chromium() -> Iterator[Any]:
    with running_chromium() as browser:
        yield browser


@pytest.fixture
def world(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[World]:
    """A robot in the office, or in the world that the test names."""
    with running_world(tmp_path, world=getattr(request, "param", "office")) as running:
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
