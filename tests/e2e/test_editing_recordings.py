"""A recording is shown on its time axis and edited, step by step, on a phone.

tests/robot/recordings and tests/server/recordings test what an edit does to a recording.
"""

from __future__ import annotations

import shutil
import zipfile
from pathlib import Path
from typing import Any

import httpx
import pytest

from robot.types import Action
from server.recordings.part import Recordings
from tests.kit.wait import wait_until

from .recordings import FILMED, put_recording
from .world import World, settle


def open_recording(phone: Any) -> None:
    phone.evaluate("location.hash = 'home'")
    phone.locator("button[aria-label*='20']").tap()
    phone.wait_for_selector(".timeline .you[d]")


def press(phone: Any, name: str) -> None:
    phone.get_by_role("button", name=name, exact=True).tap()


def test_a_recording_is_named_protected_cut_relabelled_and_split_on_the_page(
    rovers_phone: Any, shelf: World
) -> None:
    store, phone = shelf.persistence.part(Recordings).episodes, rovers_phone
    [episode_id] = store.ids()
    ids = list(store.open(episode_id).frames)
    open_recording(phone)
    for label in ("Time", "From", "To"):
        spoken = phone.get_by_label(label, exact=True).get_attribute("aria-valuetext")
        assert spoken and " s" in spoken, f"a screen reader reads {label} in seconds"
    the_recording_is_named_and_protected(phone, store, episode_id)

    def edit(text: str, edits: int) -> None:
        """Press, and wait until the page has drawn the recording with this number of edits."""
        phone.get_by_role("button", name=text).tap()
        back = phone.get_by_role("button", name="Undo the last")
        if edits:
            back.filter(has_text=f" {edits} ").wait_for()
        else:
            back.wait_for(state="detached")
        assert len(store.notes(episode_id).edits) == edits
        settle(phone)

    def slide(label: str, to: int) -> None:
        phone.get_by_label(label, exact=True).evaluate(
            "(e, to) => { e.value = to; e.dispatchEvent(new Event('input')); }", to
        )

    slide("From", 10)
    slide("To", 40)
    assert "31 pictures" in phone.locator("p.under[role=status]").inner_text()
    edit("Leave this out", 1)
    [cut] = store.notes(episode_id).edits
    assert (cut.verb, cut.ranges) == ("delete", ((ids[10], ids[40]),))
    slide("From", 45)
    edit("Left", 2)
    assert store.notes(episode_id).relabel(ids[50]) is Action.LEFT
    edit("Undo the last", 1)
    edit("Redo", 2)
    edit("Undo the last", 1)
    edit("Undo the last", 0)
    phone.get_by_label("Time", exact=True).fill("20")
    press(phone, "Split here")
    phone.locator("article >> nth=1").wait_for()
    first, second = sorted(store.ids(), key=len)
    assert list(store.open(second).frames) == ids[20:]
    assert [i for i in ids if not store.notes(first).is_deleted(i)] == ids[:20]


def the_recording_is_named_and_protected(phone: Any, store: Any, episode_id: str) -> None:
    phone.get_by_label("Title", exact=True).fill("Round the table")
    phone.locator("article").get_by_role("button", name="Save").tap()
    phone.locator("article h3", has_text="Round the table").wait_for()
    press(phone, "Protect")
    phone.locator("article .tag", has_text="protected").wait_for()
    notes = store.notes(episode_id)
    assert (notes.title, notes.is_protected) == ("Round the table", True)
    assert phone.locator("article").get_by_role("button", name="Delete").count() == 0
    press(phone, "Protect")
    phone.locator("article .tag").wait_for(state="detached")


def test_a_recording_plays_scrubs_and_steps_by_keyboard(rovers_phone: Any, shelf: World) -> None:
    phone = rovers_phone
    open_recording(phone)
    time_slider = phone.get_by_label("Time", exact=True)
    last = int(time_slider.get_attribute("max"))
    time_slider.fill(str(last - 20))
    press(phone, "Play")
    phone.wait_for_function(
        f"() => document.querySelector('.player .facts-row input').value == {last}", timeout=20_000
    )
    phone.get_by_role("button", name="Play", exact=True).wait_for()
    phone.locator(".player").focus()
    for key in ("ArrowLeft", "ArrowLeft", "o"):
        phone.keyboard.press(key)
    assert phone.get_by_label("To", exact=True).input_value() == str(last - 2)
    time_slider.fill("12")
    phone.locator(".player").focus()
    phone.keyboard.press("i")
    assert phone.get_by_label("From", exact=True).input_value() == "12"
    phone.keyboard.press("Space")
    phone.get_by_role("button", name="Pause", exact=True).wait_for()
    phone.keyboard.press("Space")
    assert "You held: " in phone.locator(".player .seen .under").first.inner_text()
    assert not shelf.rig.loop.state.emergency, "the space bar plays while the robot stands"


def test_a_model_trained_from_recordings_is_compared_and_kept_or_dropped(
    rovers_phone: Any, shelf: World
) -> None:
    world, phone = shelf, rovers_phone
    put_recording(world)
    phone.evaluate("location.hash = 'home'")
    phone.locator("article >> nth=1").wait_for()
    phone.get_by_label("Select all").check()
    taught = f"Taught again from {2 * FILMED} examples"
    lessons = world.lessons
    begin = phone.get_by_role("button", name="Teach again from the 2 selected")
    begin.tap()
    press(phone, "Discard")
    phone.get_by_role("button", name="Discard", exact=True).wait_for(state="detached")
    assert httpx.get(f"{world.address}/api/retraining").json() == {"state": "idle"}
    assert world.lessons == lessons
    begin.tap()
    phone.locator("h3", has_text=taught).wait_for(timeout=150_000)
    assert phone.locator(".sides strong").count() == 2, "the agreement before and after"
    press(phone, "Keep and use it")
    phone.locator("h3", has_text=taught).wait_for(state="detached")
    wait_until(lambda: world.lessons == 2 * FILMED, "the robot uses the new model")
    phone.locator("toast-bar, .toasts", has_text="is now in use").first.wait_for()


def test_many_recordings_are_downloaded_in_one_zip_deleted_searched_and_erased(
    rovers_phone: Any, shelf: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, phone = shelf.persistence.part(Recordings).episodes, rovers_phone
    [first] = store.ids()
    path = store.path(first)
    for n in range(4):
        shutil.copy(path, path.with_stem(f"{'hall' if n % 2 else 'yard'} {n}"))
    before = {file.name: file.read_bytes() for file in path.parent.glob("*.mcap")}
    monkeypatch.setattr(store, "budget_bytes", 0)
    phone.evaluate("location.hash = 'home'")
    phone.locator("article >> nth=4").wait_for()
    phone.get_by_text("Nothing is deleted automatically").wait_for()
    phone.get_by_label("Select all").tap()
    with phone.expect_download() as fetched:
        phone.get_by_role("link", name="Download 5").tap()
    fetched.value.save_as(tmp_path / "home.zip")
    with zipfile.ZipFile(tmp_path / "home.zip") as archive:
        assert {name: archive.read(name) for name in archive.namelist()} == before
    press(phone, "Delete 5")
    phone.locator("toast-bar", has_text="You can restore them for 30 days").wait_for()
    assert store.ids() == []
    press(phone, "Undo")
    phone.locator("toast-bar", has_text="Restored: 5.").wait_for()
    assert {file.name: file.read_bytes() for file in path.parent.glob("*.mcap")} == before
    phone.get_by_label("Find recordings").fill("YARD simulation")
    phone.get_by_text("2 in total").wait_for()
    phone.get_by_label("Select all").tap()
    phone.get_by_text("2 selected ·").wait_for()
    settle(phone)
    press(phone, "Delete 2")
    phone.get_by_role("button", name="Restore what was deleted last").wait_for()
    phone.get_by_label("Find recordings").fill("")
    phone.get_by_text("3 in total").wait_for()
    settle(phone)
    press(phone, "Empty the trash")
    press(phone, "Delete for good")
    phone.get_by_role("button", name="Empty the trash").wait_for(state="detached")
    assert shelf.persistence.storage.trash_bytes() == 0 and len(store.ids()) == 3
