"""Only shown data is sent over the link, and the cached page is enough to reconnect."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from server.config import Config
from tests.kit.sizes import few
from tests.kit.wait import wait_until

from .world import PHONE, World, open_page, running_world, settle

pytestmark = [pytest.mark.browser, pytest.mark.slow]

COUNT_SOCKETS = """
  window.crossed = { bytes: 0 };
  const size = (data) => data.byteLength ?? new Blob([data]).size;
  window.WebSocket = class extends WebSocket {
    constructor(...args) {
      super(...args);
      this.addEventListener('message', ({ data }) => { window.crossed.bytes += size(data); });
    }
    send(data) { window.crossed.bytes += size(data); super.send(data); }
  };
"""
WATCHED_S = 1
MOST_BYTES_PER_S = 1000
ELSEWHERE = ("teaching", "undo", "home", "settings")


def hide(page: Any, *, hidden: bool) -> None:
    """Treat the page as a browser does when another tab is chosen."""
    page.evaluate(
        """(hidden) => {
          Object.defineProperty(document, 'hidden', { configurable: true, get: () => hidden });
          Object.defineProperty(document, 'visibilityState',
            { configurable: true, get: () => (hidden ? 'hidden' : 'visible') });
          document.dispatchEvent(new Event('visibilitychange'));
        }""",
        hidden,
    )


def bytes_per_s(page: Any, http_bytes: list[int]) -> float:
    settle(page)
    page.wait_for_timeout(300)
    page.evaluate("window.crossed.bytes = 0")
    http_bytes.clear()
    page.wait_for_timeout(1000 * WATCHED_S)
    return float(page.evaluate("window.crossed.bytes") + sum(http_bytes)) / WATCHED_S


def at_rest(page: Any, http_bytes: list[int]) -> float:
    """Return the bytes per second of a page on which nothing changes.

    A robot on a busy machine has news of its own, for example that it is late, and sends them at
    once. So up to five spans of a second are watched; pictures would be in all of them.
    """
    for _ in range(5):
        rate = bytes_per_s(page, http_bytes)
        if rate <= MOST_BYTES_PER_S:
            break
    return rate


def frames_of(page: Any) -> int:
    """Return the number of pictures that the page has painted."""
    return int(page.evaluate("document.querySelector('video-view').frames"))


def test_no_pictures_cross_to_a_page_that_does_not_show_them(chromium: Any, world: World) -> None:
    context = chromium.new_context(viewport=PHONE, service_workers="block")
    context.add_init_script(COUNT_SOCKETS)
    page = open_page(context, world.address)
    http_bytes: list[int] = []
    page.on("response", lambda answer: http_bytes.append(len(answer.body())))
    spent = {"drive": bytes_per_s(page, http_bytes)}
    assert spent["drive"] > MOST_BYTES_PER_S, "the meter does not count"
    for screen in few(ELSEWHERE, 2):
        page.evaluate(f"location.hash = '{screen}'")
        # A worker receives the pictures, and the page's meter does not see its socket.
        wait_until(lambda: world.services.hub.video.viewers == 0, f"no pictures go to {screen}")
        spent[screen] = at_rest(page, http_bytes)
    page.evaluate("location.hash = 'drive'")
    drawn = frames_of(page)
    wait_until(lambda: frames_of(page) > drawn, "pictures come again")
    hide(page, hidden=True)
    wait_until(lambda: world.services.hub.video.viewers == 0, "no pictures go to a hidden page")
    spent["hidden"] = at_rest(page, http_bytes)
    frames = frames_of(page)
    back_ms = page.evaluate(
        """async () => {
          const view = document.querySelector('video-view');
          const before = view.frames;
          const start = performance.now();
          delete document.hidden;
          delete document.visibilityState;
          document.dispatchEvent(new Event('visibilitychange'));
          while (view.frames === before) await new Promise((done) => setTimeout(done, 2));
          return performance.now() - start;
        }"""
    )
    assert frames_of(page) > frames
    print("bytes a second:", {k: round(v) for k, v in spent.items()}, f"back in {back_ms:.0f} ms")
    del spent["drive"]
    assert {screen for screen, rate in spent.items() if rate > MOST_BYTES_PER_S} == set()
    wait_until(lambda: world.services.hub.lease.owner is not None, "the page still has the wheel")
    context.close()


def test_the_first_visit_is_enough_to_come_back(chromium: Any, tmp_path: Path) -> None:
    context = chromium.new_context(viewport=PHONE)
    with running_world(tmp_path) as world:
        page = open_page(context, world.address)
        page.evaluate("navigator.serviceWorker.ready.then(() => true)")
        page.wait_for_function("() => navigator.serviceWorker.controller !== null")
        address, port = world.address, int(world.address.rsplit(":", 1)[1])
    page.goto(address)
    page.locator(".notice", has_text="No answer").wait_for(timeout=40_000)
    for screen in ("gallery", "study", *ELSEWHERE):
        page.evaluate(f"location.hash = '{screen}'")
        page.wait_for_selector(f"{screen}-screen", state="attached")
    page.evaluate("location.hash = 'drive'")
    with running_world(tmp_path, config=Config(port=port, data=tmp_path)):
        page.wait_for_selector("video-view:not(.away)[data-frames]", timeout=40_000)
        assert page.locator("drive-pad .move").count() == 3
    context.close()
