"""A late answer of the robot moves no button that is already shown.

If a button moved, a finger that aims at "Save" would tap on something else.
"""

from __future__ import annotations

from typing import Any

import pytest

from server.recordings.part import Recordings
from tests.kit.sizes import combined
from tests.kit.wait import wait_until

from .world import DESKTOP, World, new_context, open_page

ORDERS = ("as asked", "last first")
SCREENS = ("gallery", "why", "teaching", "undo", "study", "home", "settings")

HOLD = """() => {
  const [fetched, later] = [window.fetch, window.setTimeout];
  const held = [];
  const places = () => {
    const found = {};
    for (const e of document.querySelectorAll('#other :is(button, input, a, select, summary)')) {
      const { left, top, width, height } = e.getBoundingClientRect();
      if (!width || !height) continue;
      const name = e.ariaLabel || e.textContent || e.labels?.[0]?.textContent || e.type;
      let key = name;
      for (let n = 2; key in found; n += 1) key = `${name} ${n}`;
      found[key] = [left, top + document.querySelector('#other').scrollTop].map(Math.round);
    }
    return found;
  };
  window.fetch = async (...what) => {
    const answer = await fetched(...what);
    await new Promise((go) => held.push(go));
    return answer;
  };
  // However long this takes here, no screen may lose its patience.
  window.setTimeout = (act, ms, ...rest) => (ms >= 2000 ? 0 : later(act, ms, ...rest));
  window.release = async (order, wanted) => {
    const moved = [];
    let before = places();
    const isThere = () =>
      !document.querySelector('#other [aria-busy]') && (!wanted || wanted in before);
    for (let [quiet, answers, rounds] = [0, 0, 0]; quiet < 4 && rounds < 1200; rounds += 1) {
      const go = order === 'as asked' ? held.shift() : held.pop();
      go?.();
      quiet = go || window.isFetching() || !isThere() ? 0 : quiet + 1;
      answers += go ? 1 : 0;
      await new Promise((moment) => later(moment, 50));
      const after = places();
      for (const name of Object.keys(before)) {
        if (after[name] && String(after[name]) !== String(before[name])) {
          moved.push(`answer ${answers}: ${name} from ${before[name]} to ${after[name]}`);
        }
      }
      before = after;
    }
    return { moved, shown: Object.keys(before) };
  };
  window.letGo = () => {
    [window.fetch, window.setTimeout] = [fetched, later];
    for (const go of held) go();
  };
}"""


def answers(page: Any, order: str, wanted: str = "") -> set[str]:
    """Let the answers arrive one by one until the wanted content is shown and no request is
    pending; nothing may move meanwhile. Return the names of the elements that the page shows.
    """
    came = page.evaluate("([order, wanted]) => release(order, wanted)", [order, wanted])
    assert came["moved"] == []
    return set(came["shown"])


def test_a_screen_that_opens_moves_nothing_that_it_shows(rovers_phone: Any, shelf: World) -> None:
    page = rovers_phone
    for screen, order in combined(SCREENS, ORDERS):
        page.evaluate("location.hash = 'drive'")
        page.evaluate(HOLD)
        page.evaluate(f"location.hash = '{screen}'")
        page.wait_for_selector(f"{screen}-screen", state="attached")
        assert answers(page, order), f"{screen}: nothing was shown"
        page.evaluate("letGo()")


@pytest.mark.parametrize("order", ORDERS)
def test_a_recording_opens_and_is_named_without_moving_a_button(
    rovers_phone: Any, shelf: World, order: str
) -> None:
    page, episodes = rovers_phone, shelf.persistence.part(Recordings).episodes
    [episode_id] = episodes.ids()
    episodes.set_title(episode_id, "Kitchen")  # a title as high as the recording's name
    page.evaluate(HOLD)
    page.evaluate("location.hash = 'home'")
    page.wait_for_selector("home-screen", state="attached")
    answers(page, order, "More about Kitchen")
    page.get_by_label("More about Kitchen").tap()
    assert {"Save", "Leave this out", "Title"} <= answers(page, order, "Save")
    page.get_by_label("Title", exact=True).fill("Round the table")
    page.locator("article").get_by_role("button", name="Save").tap()
    shown = answers(page, order, "More about Round the table")
    assert "Leave this out" in shown, "the recording is still open"
    assert episodes.notes(episode_id).title == "Round the table"
    page.evaluate("letGo()")


def test_a_screen_is_shown_even_if_the_robot_does_not_answer(rovers_phone: Any) -> None:
    rovers_phone.evaluate(
        "() => { window.answering = window.fetch; window.fetch = () => new Promise(() => {}); }"
    )
    rovers_phone.evaluate("location.hash = 'settings'")
    rovers_phone.get_by_label("Language").wait_for()
    rovers_phone.evaluate("() => { window.fetch = window.answering; }")


def test_the_map_moves_no_button_when_it_comes(chromium: Any, world: World) -> None:
    """The page loads the map's file after the first picture, when a finger may already aim."""
    context = new_context(chromium, DESKTOP)
    on_its_way: list[Any] = []
    context.route("**/*-screens.js", lambda route: on_its_way.append(route))
    page = open_page(context, world.address)
    wait_until(lambda: page.evaluate("true") and on_its_way, "the page requests the map")
    places = (
        "[...document.querySelectorAll('drive-pad button')].map(b => b.getBoundingClientRect())"
    )
    before = page.evaluate(places)
    on_its_way[0].continue_()
    page.locator("drive-map .body").first.wait_for(state="attached")
    assert page.evaluate(places) == before
    context.close()
