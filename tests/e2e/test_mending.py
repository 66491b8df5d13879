"""A recording is seen along its time and mended, step by step, on a phone."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from robot.types import Action, Mode, PilotCommand

from .test_everyone import complaints
from .world import World, finish_recording


def drive(world: World, seconds: float) -> None:
    loop, clock = world.rig.loop, world.rig.clock
    loop.set_mode(Mode.TRAIN).result(5)
    ends_s = clock.now_s() + seconds
    while (now_s := clock.now_s()) < ends_s:
        held = Action.LEFT if int(now_s * 2) % 2 else Action.FORWARD
        frame_id = loop.state.frame_id
        loop.command(
            PilotCommand(held=held, frame_id=frame_id, seq=int(now_s * 1e3), received_s=now_s)
        )
        time.sleep(0.05)
    loop.set_mode(Mode.STOPPED).result(5)


def test_a_recording_is_cut_relabelled_and_restored_on_the_page(phone: Any, world: World) -> None:
    drive(world, 3.0)
    persistence = world.persistence
    finish_recording(world)
    [episode_id] = persistence.episodes.ids()
    phone.evaluate("location.hash = 'home'")
    phone.wait_for_selector(".timeline, button[aria-label*='20']")
    phone.locator("button[aria-label*='20']").tap()
    phone.wait_for_selector(".timeline .you[d]")
    assert phone.locator(".timeline path.robot").get_attribute("d").startswith("M")

    def press(text: str, edits: int) -> None:
        phone.get_by_role("button", name=text).tap()
        deadline = time.monotonic() + 5
        while len(persistence.episodes.notes(episode_id).edits) != edits:
            assert time.monotonic() < deadline, f"{text}: nothing happened"
            time.sleep(0.05)
        phone.wait_for_timeout(300)

    def slide(label: str, to: int) -> None:
        phone.get_by_label(label, exact=True).evaluate(
            "(e, to) => { e.value = to; e.dispatchEvent(new Event('input')); }", to
        )

    ids = list(persistence.episodes.open(episode_id).frames)
    slide("From", 10)
    slide("To", 40)
    assert "31 pictures" in phone.locator("p.under[role=status]").inner_text()
    press("Leave this out", 1)
    [edit] = persistence.episodes.notes(episode_id).edits
    assert (edit.verb, edit.ranges) == ("delete", ((ids[10], ids[40]),))
    slide("From", 45)
    press("Right", 2)
    assert persistence.episodes.notes(episode_id).relabel(ids[50]) is Action.RIGHT
    press("Take back the last", 1)
    press("Take back the last", 0)
    wide = phone.evaluate("document.documentElement.scrollWidth - innerWidth")
    assert wide <= 0


def test_a_recording_is_named_and_protected_on_the_page(phone: Any, world: World) -> None:
    drive(world, 1.0)
    persistence = world.persistence
    finish_recording(world)
    [episode_id] = persistence.episodes.ids()
    phone.evaluate("location.hash = 'home'")
    phone.locator("button[aria-label*='20']").tap()
    phone.get_by_label("Title", exact=True).fill("Round the table")
    phone.locator("article").get_by_role("button", name="Save").tap()
    phone.locator("article h3", has_text="Round the table").wait_for()
    phone.get_by_role("button", name="Protect", exact=True).tap()
    phone.locator("article .tag", has_text="protected").wait_for()
    notes = persistence.episodes.notes(episode_id)
    assert (notes.title, notes.is_protected) == ("Round the table", True)
    phone.get_by_role("button", name="Protect", exact=True).tap()
    phone.locator("article .tag").wait_for(state="detached")
    assert not persistence.episodes.notes(episode_id).is_protected


def test_axe_finds_nothing_among_the_tools(phone: Any, world: World, npm_modules: Path) -> None:
    drive(world, 2.0)
    finish_recording(world)
    phone.evaluate("location.hash = 'home'")
    phone.wait_for_selector("button[aria-label*='20']")
    phone.locator("button[aria-label*='20']").tap()
    phone.wait_for_selector(".timeline .you[d]")
    phone.evaluate((npm_modules / "axe-core" / "axe.min.js").read_text())
    assert complaints(phone) == []


def test_recordings_beyond_their_space_are_offered(phone: Any, world: World) -> None:
    drive(world, 1.0)
    persistence = world.persistence
    finish_recording(world)
    persistence.episodes.budget_bytes = 0
    phone.evaluate("location.hash = 'home'")
    phone.wait_for_selector("text=Nothing is deleted by itself")
    assert len(persistence.episodes.ids()) == 1
