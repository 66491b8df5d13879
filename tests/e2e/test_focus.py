"""A keyboard user finds the focus where it was, whatever is redrawn."""

from __future__ import annotations

from typing import Any

import pytest

from .world import World, settle, show

pytestmark = [pytest.mark.browser, pytest.mark.slow]


def focused(page: Any) -> str:
    """Return the name of the focused element."""
    name: str = page.evaluate(
        """() => {
          const { activeElement: e } = document;
          return e.getAttribute('aria-label') ?? e.value ?? e.textContent.slice(0, 40);
        }"""
    )
    return name


def to_another(control: Any) -> str:
    """Return the key that leaves the chosen item of a list, because a robot's colour is random."""
    is_last = control.evaluate("(list) => list.selectedIndex === list.options.length - 1")
    return "ArrowUp" if is_last else "ArrowDown"


def test_the_focus_stays_on_what_was_changed(rovers_desktop: Any, rover: World) -> None:
    page = rovers_desktop
    show(page, "settings")
    colour, place = page.get_by_label("Colour"), page.get_by_label("Place", exact=True)
    for control, key, after in (
        (colour, to_another(colour), "Colour"),
        (place, to_another(place), "Place"),
        (page.locator("[name=size]:checked"), "ArrowDown", "64"),
        (page.locator("[type=checkbox][value=backward]"), "Space", "backward"),
    ):
        before = page.locator("settings-screen fieldset").first.element_handle()
        control.focus()
        page.keyboard.press(key)
        page.wait_for_function("(e) => !e.isConnected", arg=before)
        settle(page)
        assert focused(page) == after
    show(page, "home")
    more = page.locator("home-screen .model button[aria-expanded]").first
    more.focus()
    name = focused(page)
    for _ in range(2):
        page.keyboard.press("Enter")
        settle(page)
        assert focused(page) == name


def test_a_menu_that_is_left_gives_the_focus_back(rovers_desktop: Any) -> None:
    rovers_desktop.get_by_role("button", name="Menu").focus()
    rovers_desktop.keyboard.press("Enter")
    rovers_desktop.keyboard.press("Tab")
    assert focused(rovers_desktop) == "Drive"
    rovers_desktop.keyboard.press("Escape")
    assert focused(rovers_desktop) == "Menu"
