"""A recording is shown on its time axis and edited, step by step, on a phone."""

from __future__ import annotations

import shutil
import time
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest

from robot.exchange.drive import Drive, FrameEvent, write_episode
from robot.types import Action, Mode, PilotCommand
from server.recordings.part import Recordings

from .recordings import FILMED, film_a_good_pilot, put_recording
from .test_everyone import complaints
from .world import World, finish_recording, settle

FORWARD = Action.FORWARD


@pytest.fixture
def frame_rate_hz() -> float:
    """A high rate, so that short drives are long recordings."""
    return 30.0


def drive(world: World, examples: int) -> None:
    """Drive without a page until enough was taught; begin again after each stop on a busy
    machine."""
    loop, clock = world.rig.loop, world.rig.clock
    latest_s = clock.now_s() + 60.0
    while world.lessons < examples:
        now_s = clock.now_s()
        assert now_s < latest_s, f"only {world.lessons} examples were taught"
        if world.mode is not Mode.TRAIN:
            loop.set_mode(Mode.TRAIN).result(60)
        held = Action.LEFT if int(now_s * 2) % 2 else Action.FORWARD
        frame_id = loop.state.frame_id
        loop.command(
            PilotCommand(held=held, frame_id=frame_id, seq=int(now_s * 1e3), received_s=now_s)
        )
        time.sleep(0.05)
    loop.set_mode(Mode.STOPPED).result(60)


def test_a_recording_is_cut_relabelled_and_restored_on_the_page(phone: Any, world: World) -> None:
    drive(world, 60)
    persistence = world.persistence
    finish_recording(world)
    [episode_id] = persistence.part(Recordings).episodes.ids()
    phone.evaluate("location.hash = 'home'")
    phone.wait_for_selector(".timeline, button[aria-label*='20']")
    phone.locator("button[aria-label*='20']").tap()
    phone.wait_for_selector(".timeline .you[d]")
    assert phone.locator(".timeline path.robot").get_attribute("d").startswith("M")

    def press(text: str, edits: int) -> None:
        """Press, and wait until the page has drawn the recording with this number of edits."""
        phone.get_by_role("button", name=text).tap()
        back = phone.get_by_role("button", name="Undo the last")
        if edits:
            back.filter(has_text=f" {edits} ").wait_for()
        else:
            back.wait_for(state="detached")
        assert len(persistence.part(Recordings).episodes.notes(episode_id).edits) == edits
        settle(phone)

    def slide(label: str, to: int) -> None:
        phone.get_by_label(label, exact=True).evaluate(
            "(e, to) => { e.value = to; e.dispatchEvent(new Event('input')); }", to
        )

    ids = list(persistence.part(Recordings).episodes.open(episode_id).frames)
    slide("From", 10)
    slide("To", 40)
    assert "31 pictures" in phone.locator("p.under[role=status]").inner_text()
    press("Leave this out", 1)
    [edit] = persistence.part(Recordings).episodes.notes(episode_id).edits
    assert (edit.verb, edit.ranges) == ("delete", ((ids[10], ids[40]),))
    slide("From", 45)
    press("Right", 2)
    assert persistence.part(Recordings).episodes.notes(episode_id).relabel(ids[50]) is Action.RIGHT
    press("Undo the last", 1)
    press("Undo the last", 0)
    wide = phone.evaluate("document.documentElement.scrollWidth - innerWidth")
    assert wide <= 0


def test_a_recording_is_named_and_protected_on_the_page(rovers_phone: Any, shelf: World) -> None:
    persistence, phone = shelf.persistence, rovers_phone
    [episode_id] = persistence.part(Recordings).episodes.ids()
    phone.evaluate("location.hash = 'home'")
    phone.locator("button[aria-label*='20']").tap()
    phone.get_by_label("Title", exact=True).fill("Round the table")
    phone.locator("article").get_by_role("button", name="Save").tap()
    phone.locator("article h3", has_text="Round the table").wait_for()
    phone.get_by_role("button", name="Protect", exact=True).tap()
    phone.locator("article .tag", has_text="protected").wait_for()
    notes = persistence.part(Recordings).episodes.notes(episode_id)
    assert (notes.title, notes.is_protected) == ("Round the table", True)
    phone.get_by_role("button", name="Protect", exact=True).tap()
    phone.locator("article .tag").wait_for(state="detached")
    assert not persistence.part(Recordings).episodes.notes(episode_id).is_protected


@pytest.mark.usefixtures("shelf")
def test_axe_finds_nothing_among_the_tools(rovers_phone: Any, npm_modules: Path) -> None:
    phone = rovers_phone
    open_recording(phone)
    phone.evaluate((npm_modules / "axe-core" / "axe.min.js").read_text())
    assert complaints(phone) == []


def test_recordings_beyond_their_space_are_offered(
    rovers_phone: Any, shelf: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    episodes = shelf.persistence.part(Recordings).episodes
    monkeypatch.setattr(episodes, "budget_bytes", 0)
    rovers_phone.evaluate("location.hash = 'home'")
    rovers_phone.wait_for_selector("text=Nothing is deleted automatically")
    assert len(episodes.ids()) == 1


def spoil(film: tuple[FrameEvent, ...]) -> tuple[list[FrameEvent], list[tuple[int, int, Action]]]:
    """Mislabel a fifth of the examples, in two stretches; return also the repair: first and last
    index of each stretch, and the right label, which is the same in both."""
    shots, runs = list(film), []
    begin = 0
    for i in range(1, len(shots) + 1):
        if i == len(shots) or shots[i].label != shots[begin].label:
            runs.append((begin, i - 1))
            begin = i
    wrong = sorted(runs, key=lambda run: run[0] - run[1])[:2]
    most = len(shots) // 10
    repairs = []
    for first, last in sorted(wrong):
        last = min(last, first + most - 1)
        right = shots[first].label
        assert right is not None
        repairs.append((first, last, right))
        for i in range(first, last + 1):
            shots[i] = replace(shots[i], label=Action.LEFT if right is FORWARD else FORWARD)
    return shots, repairs


def open_recording(phone: Any) -> None:
    phone.evaluate("location.hash = 'home'")
    phone.locator("button[aria-label*='20']").tap()
    phone.wait_for_selector(".timeline .you[d]")


def test_two_relabels_repair_a_recording_and_before_and_after_say_so(
    phone: Any, world: World
) -> None:
    """A fifth of the labels is wrong; they are corrected on the page, taught again, and saved."""
    shots, repairs = spoil(film_a_good_pilot(400))
    assert sum(last - first + 1 for first, last, _ in repairs) >= 0.15 * len(shots)
    store = world.services.persistence.part(Recordings).episodes
    moves = (FORWARD, Action.LEFT)
    film = Drive(name="film", source="simulation", shots=shots, moves=moves)
    write_episode(film, store.new_path("2026-01-01_120000_000"))
    open_recording(phone)
    for number, (first, last, right) in enumerate(repairs, start=1):
        steps = (("To", len(shots) - 1), ("From", 0), ("To", last), ("From", first))
        for label, index in steps:
            phone.get_by_label(label, exact=True).evaluate(
                "(e, to) => { e.value = to; e.dispatchEvent(new Event('input')); }", index
            )
        phone.locator(".row button", has_text="Forward" if right is FORWARD else "Left").tap()
        phone.get_by_role("button", name=f"Undo the last of {number}").wait_for()
    phone.get_by_role("button", name="Teach again", exact=True).tap()
    phone.locator(".sides").wait_for(timeout=150_000)
    before, after = (float(s.split()[0]) for s in phone.locator(".sides strong").all_inner_texts())
    print(f"agreement before {before:.0f} %, after {after:.0f} %")
    assert after >= before + 5
    assert phone.locator("home-screen .strip img").count() > 0
    phone.get_by_role("button", name="Keep and use it").tap()
    phone.locator("toast-bar, .toasts", has_text="is now in use").first.wait_for()
    assert world.lessons == len(shots)
    assert len(world.services.persistence.models.names()) == 1


def test_a_recording_plays_scrubs_and_steps_by_keyboard(rovers_phone: Any, shelf: World) -> None:
    world, phone = shelf, rovers_phone
    open_recording(phone)
    time_slider = phone.get_by_label("Time", exact=True)
    last = int(time_slider.get_attribute("max"))
    phone.get_by_role("button", name="Play", exact=True).tap()
    phone.wait_for_function(
        f"() => document.querySelector('.player .facts-row input').value == {last}", timeout=20_000
    )
    phone.get_by_role("button", name="Play", exact=True).wait_for()
    phone.locator(".player").focus()
    phone.keyboard.press("ArrowLeft")
    phone.keyboard.press("ArrowLeft")
    assert time_slider.input_value() == str(last - 2)
    phone.keyboard.press("o")
    assert phone.get_by_label("To", exact=True).input_value() == str(last - 2)
    time_slider.fill("0")  # it plays for a while from there
    phone.locator(".player").focus()
    phone.keyboard.press("Space")
    phone.get_by_role("button", name="Pause", exact=True).wait_for()
    phone.keyboard.press("Space")
    time_slider.fill("12")
    phone.keyboard.press("i")
    assert phone.get_by_label("From", exact=True).input_value() == "12"
    assert "You held: " in phone.locator(".player .seen .under").first.inner_text()
    assert not world.rig.loop.state.emergency, "space played; it is the stop while the robot moves"


def test_what_was_taken_back_can_be_made_again_and_a_recording_split(
    rovers_phone: Any, shelf: World
) -> None:
    store, phone = shelf.persistence.part(Recordings).episodes, rovers_phone
    [episode_id] = store.ids()
    open_recording(phone)
    phone.get_by_role("button", name="Leave this out").tap()
    phone.get_by_role("button", name="Undo the last").tap()
    phone.get_by_role("button", name="Redo").tap()
    phone.get_by_role("button", name="Undo the last").tap()
    phone.get_by_role("button", name="Redo").wait_for()
    assert store.notes(episode_id).edits == ()
    phone.get_by_label("Time", exact=True).fill("20")
    phone.get_by_role("button", name="Split here").tap()
    phone.locator("article >> nth=1").wait_for()
    ids = list(store.open(episode_id).frames)
    first, second = sorted(store.ids(), key=len)
    assert list(store.open(second).frames) == ids[20:]
    kept = [i for i in ids if not store.notes(first).is_deleted(i)]
    assert kept == ids[:20]


def test_a_protected_recording_is_not_deleted_by_a_tap(rovers_phone: Any, shelf: World) -> None:
    world, phone = shelf, rovers_phone
    store = world.persistence.part(Recordings).episodes
    [episode_id] = store.ids()
    store.protect(episode_id, True)
    open_recording(phone)
    assert phone.locator("article").get_by_role("button", name="Delete").count() == 0
    answer = httpx.delete(f"{world.address}/api/episodes/{episode_id}")
    assert answer.status_code == 409
    assert "protected" in answer.json()["detail"]
    assert store.ids() == [episode_id]


def test_two_recordings_are_taught_together(rovers_phone: Any, shelf: World) -> None:
    world, phone = shelf, rovers_phone
    put_recording(world)
    phone.evaluate("location.hash = 'home'")
    phone.locator("article >> nth=1").wait_for()
    phone.get_by_label("Select all").check()
    phone.get_by_role("button", name="Teach again from the 2 selected").tap()
    phone.get_by_text("Taught again from").wait_for(timeout=150_000)
    shown = phone.locator("h3", has_text="Taught again").inner_text()
    assert shown == f"Taught again from {2 * FILMED} examples"
    phone.get_by_role("button", name="Discard").tap()
    phone.get_by_text("Taught again from").wait_for(state="detached")
    assert world.lessons == 0


def test_teaching_again_is_followed_though_an_answer_is_lost(
    rovers_phone: Any, shelf: World
) -> None:
    asked: list[str] = []

    def answer(route: Any) -> None:
        """A training run is in progress, then unreachable for a moment, then done."""
        asked.append(route.request.method)
        state = {"state": "running", "share": 0.5} if len(asked) < 3 else {"state": "idle"}
        if len(asked) == 2:
            route.abort()
        else:
            route.fulfill(json=state)

    rovers_phone.route("**/api/retraining", answer)
    rovers_phone.evaluate("location.hash = 'home'")
    rovers_phone.locator("home-screen progress").wait_for()
    rovers_phone.locator("home-screen progress").wait_for(state="detached")
    rovers_phone.unroute("**/api/retraining")
    assert asked == ["GET"] * 3


def test_forty_recordings_are_home_in_one_zip_and_gone_in_four_touches(
    rovers_phone: Any, shelf: World, tmp_path: Path
) -> None:
    store, phone = shelf.persistence.part(Recordings).episodes, rovers_phone
    [first] = store.ids()
    path = store.path(first)
    for n in range(39):
        shutil.copy(path, path.with_stem(f"{'hall' if n % 3 else 'yard'} {n}"))
    before = {file.name: file.read_bytes() for file in path.parent.glob("*.mcap")}
    phone.evaluate("location.hash = 'drive'")
    phone.evaluate("location.hash = 'home'")  # the first touch
    phone.locator("article >> nth=39").wait_for()
    phone.get_by_label("Select all").tap()
    phone.get_by_text("40 selected ·").wait_for()
    with phone.expect_download() as fetched:
        phone.get_by_role("link", name="Download 40").tap()
    fetched.value.save_as(tmp_path / "home.zip")
    with zipfile.ZipFile(tmp_path / "home.zip") as archive:
        assert {name: archive.read(name) for name in archive.namelist()} == before
    phone.get_by_role("button", name="Delete 40").tap()
    phone.locator("toast-bar", has_text="You can restore them for 30 days").wait_for()
    assert store.ids() == []
    phone.get_by_role("button", name="Undo").tap()
    phone.locator("toast-bar", has_text="Restored: 40.").wait_for()
    assert {file.name: file.read_bytes() for file in path.parent.glob("*.mcap")} == before
    phone.get_by_label("Find recordings").fill("YARD simulation")
    phone.get_by_text("13 in total").wait_for()
    phone.get_by_label("Select all").tap()
    phone.get_by_text("13 selected ·").wait_for()
    assert phone.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0
    settle(phone)
    phone.get_by_role("button", name="Delete 13").tap()
    phone.get_by_role("button", name="Restore the last deleted").wait_for()
    phone.get_by_label("Find recordings").fill("")
    phone.get_by_text("27 in total").wait_for()
    settle(phone)
    phone.get_by_role("button", name="Empty the trash").tap()
    phone.get_by_role("button", name="Delete for good").tap()
    phone.get_by_role("button", name="Empty the trash").wait_for(state="detached")
    assert shelf.persistence.storage.trash_bytes() == 0 and len(store.ids()) == 27
