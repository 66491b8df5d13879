"""A screen reader's view of driving and editing: names, roles, states and their order.

That every control has a name is tested with axe (test_everyone.py).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from robot.types import Mode

from .class_world import running_class
from .hand import choose
from .test_everyone import complaints
from .world import World

pytestmark = pytest.mark.browser


def hears(page: Any, told: str) -> None:
    """Check that these are read out, in this order and with these states, among others."""
    from playwright.sync_api import expect

    expect(page.locator("body")).to_match_aria_snapshot(told, timeout=60_000)


def test_editing_a_recording_is_read_out_with_times_and_states(
    rovers_desktop: Any, shelf: World
) -> None:
    desktop = rovers_desktop
    shelf.persistence.autosave.save()
    desktop.evaluate("location.hash = 'home'")
    desktop.locator("button[aria-label*='20']").click()
    desktop.wait_for_selector(".timeline .you[d]")
    hears(
        desktop,
        """
        - banner:
          - link "Back to driving"
          - heading "Models and recordings" [level=1]
          - button "STOP"
        - main:
          - heading "What this robot knows" [level=2]
          - list:
            - listitem:
              - heading "Rover in use" [level=3]
          - button "Upload"
          - heading "Recordings" [level=2]
          - checkbox "Select all"
          - status
          - article:
            - checkbox /Select/
            - button /More about/ [expanded]
            - group /Recording/:
              - img /What you held/
              - button "Play"
              - slider "Time"
              - status
              - slider "From"
              - button "From here"
              - slider "To"
              - button "To here"
            - button "Keep only this"
            - button "Leave this out"
            - button "Split here"
            - group /Here, the robot should go/:
              - /children: equal
              - text: /.+/
              - button "Forward"
              - button "Left"
            - button "Teach again"
            - button "Delete"
        """,
    )
    assert desktop.get_by_role("button", name="Upload").count() == 1
    for label in ("Time", "From", "To"):
        spoken = desktop.get_by_label(label, exact=True).get_attribute("aria-valuetext")
        assert spoken and " s" in spoken, f"{label} is read out in seconds, not in pictures"


def test_driving_is_read_out_in_the_order_of_its_use(rovers_desktop: Any, rover: World) -> None:
    hears(
        rovers_desktop,
        """
        - banner:
          - heading "Rover" [level=1]
          - button "Menu"
        - main:
          - img "What the robot sees"
          - group /What the robot would do/
          - status
          - radiogroup "Mode":
            - radio "Stop" [checked]
            - radio "Teach" [checked=false]
            - radio "Drive itself" [checked=false]
          - group "Hold to drive":
            - button "Forward"
            - button "Left"
            - button "Right"
          - button "STOP"
        """,
    )
    choose(rovers_desktop, rover, Mode.TRAIN)
    rovers_desktop.keyboard.down("ArrowLeft")
    hears(
        rovers_desktop,
        """
        - main:
          - radiogroup "Mode":
            - radio "Stop" [checked=false]
            - radio "Teach" [checked]
          - group "Hold to drive":
            - button "Forward" [pressed=false]
            - button "Left" [pressed]
        """,
    )
    rovers_desktop.keyboard.up("ArrowLeft")
    rovers_desktop.locator("drive-pad .stop").click()
    hears(
        rovers_desktop,
        """
        - main:
          - status:
            - button
          - radiogroup "Mode":
            - radio "Stop" [disabled]
            - radio "Teach" [disabled]
            - radio "Drive itself" [disabled]
        """,
    )


def test_a_class_is_read_out_robot_by_robot(
    chromium: Any, tmp_path: Path, npm_modules: Path
) -> None:
    with running_class(tmp_path, 2, 1) as school:
        context = chromium.new_context()
        page = context.new_page()
        page.goto(school.address)
        page.locator(".robot[data-status=there]").nth(1).wait_for()
        hears(
            page,
            """
            - banner:
              - heading "The class" [level=1]
              - status
              - radiogroup "What to show"
              - button "Class settings"
              - button "STOP ALL"
            - main:
              - article "Ada":
                - heading "Ada" [level=2]
                - button "STOP Ada"
                - button "More about Ada"
              - article "Bolt":
                - button "STOP Bolt"
              - article /127/:
                - button /STOP 127/
            """,
        )
        page.evaluate((npm_modules / "axe-core" / "axe.min.js").read_text())
        assert complaints(page) == []
        page.locator("button.stop").click()
        page.locator("#loud p").wait_for()
        assert page.get_by_role("alert").count() == 1
        assert complaints(page) == [], "with a robot that was not reached"
        page.locator("[data-view=codes]").click()
        page.locator(".robot .code").nth(1).wait_for()
        assert page.get_by_role("img", name="QR code that pairs a phone with Bolt").count() == 1
        page.locator(".robot .acts button:last-child").first.click()
        assert complaints(page) == [], "with codes and a robot's panel"
        context.close()
