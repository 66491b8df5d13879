from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from server.recordings.part import Recordings

from .recordings import put_recording
from .world import (
    DESKTOP,
    PHONE,
    World,
    begin_anew,
    come_to_rest,
    new_context,
    open_page,
    running_chromium,
    running_world,
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of this folder.

    All are `slow`, so that a worker runs them one after the other, with one Chromium. Timeouts are
    long, because tests wait for events and must not fail on a busy machine.
    """
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker(pytest.mark.slow)
            if "chromium" in getattr(item, "fixturenames", ()):
                item.add_marker(pytest.mark.browser)
            if not item.get_closest_marker("timeout"):
                item.add_marker(pytest.mark.timeout(300))


# Not for the session, because Playwright's event loop would block all other tests.
@pytest.fixture(scope="package")
def chromium() -> Iterator[Any]:
    with running_chromium() as browser:
        yield browser


@pytest.fixture
def frame_rate_hz() -> float:
    """Pictures per second; files whose tests must teach much use a higher rate."""
    return 5.0


@pytest.fixture
def world(request: pytest.FixtureRequest, tmp_path: Path, frame_rate_hz: float) -> Iterator[World]:
    """A served robot in the simulated office, or in the world that the test names."""
    place = getattr(request, "param", "office")
    with running_world(tmp_path, world=place, frame_rate_hz=frame_rate_hz) as running:
        yield running


@pytest.fixture
def phone(chromium: Any, world: World) -> Iterator[Any]:
    """The page on a phone."""
    context = new_context(chromium, PHONE)
    yield open_page(context, world.address)
    context.close()


@pytest.fixture
def desktop(chromium: Any, world: World) -> Iterator[Any]:
    """The page on a computer with a mouse."""
    context = new_context(chromium, DESKTOP)
    yield open_page(context, world.address)
    context.close()


@pytest.fixture(scope="module")
def rover(tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    """One robot in the office for a whole file; each of its tests finds it stopped.

    Tests share the robot's page; a test that opens another page uses its own robot (`world`).
    """
    with running_world(tmp_path_factory.mktemp("rover"), world="office") as running:
        yield running


class _OnePage:
    """Opens one page at the rover, and no other, so that this page has the wheel."""

    def __init__(self) -> None:
        self.page: Any = None
        self._viewport: dict[str, int] = {}

    def get(self, chromium: Any, rover: World, viewport: dict[str, int]) -> Any:
        """Return the page as if it had just been opened, because opening it costs a second."""
        if self.page is not None and viewport is not self._viewport:
            come_to_rest(self.page, rover)  # the last request of a closed page may arrive late
            self.close()
        if self.page is None:
            self.page, self._viewport = new_context(chromium, viewport).new_page(), viewport
        begin_anew(self.page, rover, viewport)
        return self.page

    def close(self) -> None:
        if self.page is not None:
            self.page.context.close()
        self.page, self._viewport = None, {}


@pytest.fixture(scope="module")
def _one_page() -> Iterator[_OnePage]:
    one = _OnePage()
    yield one
    one.close()


@pytest.fixture
def rovers_page(
    request: pytest.FixtureRequest, chromium: Any, rover: World, _one_page: _OnePage
) -> Iterator[Callable[[dict[str, int]], Any]]:
    """Returns the page at the rover that the tests of a file share; after a failure, a new page."""
    failed = request.session.testsfailed
    yield lambda viewport: _one_page.get(chromium, rover, viewport)
    if request.session.testsfailed > failed:
        _one_page.close()


@pytest.fixture
def rovers_phone(rovers_page: Callable[[dict[str, int]], Any]) -> Any:
    """The rover's page on a phone, shared by the tests of a file."""
    return rovers_page(PHONE)


@pytest.fixture
def shelf(rover: World) -> Iterator[World]:
    """The rover with exactly one recording; the tests teach it nothing."""
    episodes = rover.persistence.part(Recordings).episodes
    put_recording(rover)
    yield rover
    for episode_id in episodes.ids():
        if episodes.notes(episode_id).is_protected:
            episodes.protect(episode_id, False)
        episodes.delete(episode_id)


@pytest.fixture
def rovers_desktop(rovers_page: Callable[[dict[str, int]], Any]) -> Any:
    """The rover's page on a computer with a mouse, shared by the tests of a file."""
    return rovers_page(DESKTOP)
