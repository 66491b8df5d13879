"""Serves a simulated robot by a real server, and shows its page in a real Chromium."""

from __future__ import annotations

import contextlib
import json
import os
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from robot.control.config import CameraTimingConfig, GateConfig, LinkGovernorConfig, LoopConfig
from robot.devices.rig import build_rig
from robot.driver import Pose
from robot.store.folder import Storage
from robot.types import Action, Mode
from server.app import create_app
from server.clients.hub import Hub
from server.config import Config
from server.identity import IdentityFile
from server.lab.served import served
from server.persistence import Persistence
from server.recordings.part import Recordings
from server.services import Services
from tests.joined_page import WEB, joined_page
from tests.kit.needed import missing
from tests.kit.wait import wait_until

PHONE = {"width": 390, "height": 844}
LANDSCAPE = {"width": 844, "height": 390}
DESKTOP = {"width": 1280, "height": 800}
CHROMIUMS = (
    "/usr/bin/chromium-headless-shell",
    "/usr/bin/chromium",
    "/usr/bin/chromium-browser",
)
"""Paths of Chromium; the first program has no windows, and uses a third less CPU time."""
PATIENCE_MS = 90_000
"""Default timeout; it is long, because a test must not judge the speed of a machine."""
CHROMIUM_FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--mute-audio",
]


class World:
    """A running robot: its address, and its true state, independent of the page."""

    def __init__(self, address: str, services: Services) -> None:
        self.address, self.services, self.rig = address, services, services.robot

    def __str__(self) -> str:
        state, now = self.rig.loop.state, self.rig.loop.state.decision
        fault = state.fault or "no fault"
        return f"{now.mode} {now.action} {now.stop_reason}, link {state.link.level}, {fault}"

    @property
    def persistence(self) -> Persistence:
        assert self.services.persistence is not None
        return self.services.persistence

    @property
    def pose(self) -> Pose:
        pose = self.rig.driver.sense().pose
        assert pose is not None, "only a simulated robot knows its pose"
        return pose

    @property
    def mode(self) -> Mode:
        return self.rig.loop.state.decision.mode

    @property
    def action(self) -> Action:
        return self.rig.loop.state.decision.action

    @property
    def distance_m(self) -> float:
        return self.rig.loop.state.sensors.distance_m or 9.0

    @property
    def lessons(self) -> int:
        return sum(self.rig.loop.state.taught.values())


PATIENT = LoopConfig(
    gate=GateConfig(
        pilot_timeout_s=4.0,
        supervision_timeout_s=5.0,
        command_timeout_s=4.0,
        frame_timeout_s=4.0,
        start_patience_s=6.0,
    ),
    governor=LinkGovernorConfig(
        warn_s=2.7, cap_speed_s=3.3, stop_learning_s=4.2, stop_s=5.0, busy_s=3.0
    ),
    camera=CameraTimingConfig(longest_timeout_s=6.6, full_speed_s=5.0),
    stall_s=4.0,
)
"""The loop's rules with longer times. These tests check that browser and robot work together;
virtual time checks how soon the robot stops (tests/faults), independent of the machine's load."""


@contextlib.contextmanager
def running_world(folder: Path, config: Config | None = None, **options: Any) -> Iterator[World]:
    """Serve a simulated robot on a free port of this machine inside the block.

    By default the robot sends five pictures a second, because pictures are what costs these tests
    most time, in server and browser.
    """
    config = config or Config(port=0, data=folder, web=joined_page())
    options = {"frame_rate_hz": 5.0, **options}
    rig = build_rig("sim", learner="default-32", options=options, config=PATIENT)
    hub = Hub(config, rig, IdentityFile(None, "Rover"))
    persistence = Persistence(Storage(folder), rig, name="Rover", announce=hub.broadcast.announce)
    services = Services(config, rig, hub=hub, persistence=persistence)
    with rig, persistence, served(create_app(services), config) as address:
        yield World(address, services)


@contextlib.contextmanager
def passing_world(name: str) -> Iterator[World]:
    """Serve a simulated robot for the docs' pictures, with a real camera's rate, and delete its
    data after the block."""
    with (
        tempfile.TemporaryDirectory() as kept,
        running_world(Path(kept), world=name, frame_rate_hz=10.0) as world,
    ):
        yield world


def find_chromium() -> str:
    """Return Chromium's path; skips visibly if there is none, and fails in CI."""
    found = [path for path in (os.environ.get("CHROMIUM"), *CHROMIUMS) if path]
    found = [path for path in found if Path(path).exists()]
    return found[0] if found else missing("Chromium", "apt-get install chromium")


_PLAYWRIGHTS: list[Any] = []
"""The running Playwright, if any, because a process can run only one."""


@contextlib.contextmanager
def running_chromium(*flags: str) -> Iterator[Any]:
    """Start a Chromium, headless and with a fresh profile; see find_chromium.

    Its pages stand still unless a test asks for `reduced_motion="no-preference"`: an animation
    costs as much as the pictures.
    """
    from playwright.sync_api import sync_playwright

    path = find_chromium()
    with contextlib.ExitStack() as ending:
        if not _PLAYWRIGHTS:
            _PLAYWRIGHTS.append(ending.enter_context(sync_playwright()))
            ending.callback(_PLAYWRIGHTS.clear)
        launch = _PLAYWRIGHTS[0].chromium.launch
        browser = launch(executable_path=path, args=[*CHROMIUM_FLAGS, *flags])
        make = browser.new_context

        def make_patient(**options: Any) -> Any:
            context = make(**{"reduced_motion": "reduce", **options})
            context.set_default_timeout(PATIENCE_MS)
            return context

        browser.new_context = make_patient
        yield browser
        with contextlib.suppress(Exception):
            browser.close()


def new_context(browser: Any, viewport: dict[str, int], **options: Any) -> Any:
    """Return a fresh browser profile, of a phone or of a computer with a mouse.

    The profile has no service worker, which would fetch the whole page a second time; the service
    worker has tests of its own.
    """
    if viewport is not DESKTOP:
        options = {"has_touch": True, "is_mobile": True, **options}
    return browser.new_context(viewport=viewport, service_workers="block", **options)


def remember(**preferences: Any) -> str:
    """Return a script that stores these preferences before the page reads them."""
    kept = json.dumps(json.dumps(preferences))
    return f"localStorage.setItem('drivelesson.preferences', {kept})"


def open_page(context: Any, address: str, *, hints: bool = False) -> Any:
    """Open the page and wait for the first picture, without the first visit's hints."""
    page = context.new_page()
    _load(page, address, hints=hints)
    return page


def _load(page: Any, address: str, *, hints: bool = False) -> None:
    page.add_init_script(COUNT_FETCHES)
    if not hints:
        page.add_init_script(remember(hintsShown=["teach", "bars", "correct"]))
    page.goto(address)
    page.wait_for_selector("video-view[data-frames]", state="attached", timeout=60_000)


def release_stop(page: Any, world: World) -> None:
    """Release a latched emergency stop when the page knows of it and has no request pending.

    A page that does not yet know of the STOP would stop the robot once more, over HTTP.
    """
    known = "document.querySelector('app-bar')?.page?.store.state.robot?.emergency"
    if world.rig.loop.state.emergency:
        page.wait_for_function(f"() => {known}")
    page.wait_for_function("() => !isFetching()")
    world.rig.loop.release_emergency().result(60)
    page.wait_for_function(f"() => !{known}")


def come_to_rest(page: Any, world: World) -> None:
    """Stop the robot, without an emergency stop or a pending request of its page."""
    world.rig.loop.set_mode(Mode.STOPPED).result(60)
    if page.url.startswith(world.address):
        release_stop(page, world)
    else:
        world.rig.loop.release_emergency().result(60)


def begin_anew(page: Any, world: World, viewport: dict[str, int]) -> None:
    """Stop the robot, and wait until the page shows that, as if both had just started."""
    is_open = page.url.startswith(world.address)
    was_stopped = world.rig.loop.state.emergency
    come_to_rest(page, world)
    page.set_viewport_size(viewport)
    if is_open:
        page.evaluate("location.hash = 'drive'")
    else:
        _load(page, world.address)
    wait_until_free(page)
    if was_stopped:
        page.wait_for_timeout(600)  # two presses of STOP within half a second count as one


def wait_until_free(page: Any) -> None:
    """Wait until the page shows that the robot is stopped, and that this page may start it."""
    page.wait_for_selector("mode-bar [data-mode=stopped][aria-checked=true]")
    page.wait_for_selector("mode-bar [data-mode=train][aria-disabled=false]")


COUNT_FETCHES = """
  let underway = 0;
  const fetched = window.fetch;
  window.fetch = async (...what) => {
    underway += 1;
    try { return await fetched(...what); } finally { setTimeout(() => { underway -= 1; }); }
  };
  window.isFetching = () => underway > 0;
"""
_SETTLED = """async ([quietMs, longestMs]) => {
  const start = performance.now();
  let changedMs = start;
  const watch = new MutationObserver(() => { changedMs = performance.now(); });
  watch.observe(document.querySelector('#other'), { subtree: true, childList: true });
  for (;;) {
    await new Promise((done) => setTimeout(done, 20));
    const nowMs = performance.now();
    if (!window.isFetching() && nowMs - changedMs >= quietMs) break;
    if (nowMs - start > longestMs) break;  // a screen that is never quiet is judged as it is
  }
  watch.disconnect();
}"""


def show(page: Any, screen: str) -> None:
    """Go to a screen, and wait until it has received and drawn all of its data."""
    page.evaluate(f"location.hash = '{screen}'")
    if screen != "drive":
        page.wait_for_selector(f"{screen}-screen", state="attached")
    settle(page)


def settle(page: Any) -> None:
    """Wait until the screen sends no more requests and adds no more elements."""
    page.evaluate(_SETTLED, [100, 5000])


def finish_recording(world: World) -> None:
    """End the recording now; otherwise it ends when the robot has stood for a while."""
    recorder = world.persistence.part(Recordings).recorder
    world.rig.loop.submit(recorder.finish).result(60)
    wait_until(lambda: recorder.recording.episode_id is None, "the recording ends")


def sentences(language: str) -> dict[str, str]:
    """Return the page's sentences of one language, by their keys."""
    files = (WEB / "js").rglob(f"messages/{language}.js")
    text = "".join(path.read_text("utf-8") for path in files)
    pairs = re.findall(r"^  '?([\w.]+)'?: '(.*)',$", text, re.MULTILINE)
    return {key: sentence.replace("\\'", "'") for key, sentence in pairs}
