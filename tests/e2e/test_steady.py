"""Nothing moves under a finger: a late answer of the robot moves no button that is already shown.

Otherwise a finger on its way to "Save" would tap on something that arrived above it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from server.recordings.part import Recordings
from tests.kit.sizes import crossed

from .world import World

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


def answer(phone: Any, order: str, wanted: str = "") -> Any:
    """Let the answers arrive one by one until the wanted content is shown and no request is
    pending.

    Returns:
        What of the page moved meanwhile, and the names of what it shows.
    """
    return phone.evaluate("([order, wanted]) => release(order, wanted)", [order, wanted])


@pytest.fixture
def slow(rovers_phone: Any) -> Iterator[Any]:
    """The rover's page, whose answers arrive only when the test releases them."""
    rovers_phone.evaluate(HOLD)
    yield rovers_phone
    rovers_phone.evaluate("letGo()")


@crossed(order=["as asked", "last first"], screen=SCREENS)
@pytest.mark.usefixtures("shelf")
def test_a_screen_that_opens_moves_nothing_that_it_shows(
    slow: Any, screen: str, order: str
) -> None:
    slow.evaluate(f"location.hash = '{screen}'")
    slow.wait_for_selector(f"{screen}-screen", state="attached")
    answered = answer(slow, order)
    assert answered["moved"] == []
    assert answered["shown"], "nothing was shown at all"


@pytest.mark.parametrize("order", ["as asked", "last first"])
def test_a_recording_opens_and_is_named_without_moving_a_button(
    slow: Any, shelf: World, order: str
) -> None:
    episodes = shelf.persistence.part(Recordings).episodes
    [episode_id] = episodes.ids()
    episodes.set_title(episode_id, "Kitchen")  # as high as the other name
    slow.evaluate("location.hash = 'home'")
    slow.wait_for_selector("home-screen", state="attached")
    answer(slow, order, "More about Kitchen")
    slow.get_by_label("More about Kitchen").tap()
    opened = answer(slow, order, "Save")
    assert opened["moved"] == []
    assert {"Save", "Leave this out", "Title"} <= set(opened["shown"])
    slow.get_by_label("Title", exact=True).fill("Round the table")
    slow.locator("article").get_by_role("button", name="Save").tap()
    saved = answer(slow, order, "More about Round the table")
    assert saved["moved"] == []
    assert "Leave this out" in saved["shown"], "the recording was closed"
    assert episodes.notes(episode_id).title == "Round the table"


def test_a_screen_is_shown_even_if_the_robot_does_not_answer(rovers_phone: Any) -> None:
    rovers_phone.evaluate(
        "() => { window.answering = window.fetch; window.fetch = () => new Promise(() => {}); }"
    )
    rovers_phone.evaluate("location.hash = 'settings'")
    rovers_phone.get_by_label("Language").wait_for()
    rovers_phone.evaluate("() => { window.fetch = window.answering; }")
