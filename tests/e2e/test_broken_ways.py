"""The page's messages on a broken network path, in a real Chromium, compared with the truth."""

from __future__ import annotations

import base64
import contextlib
import datetime as dt
import hashlib
import re
import signal
import ssl
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from robot.types import Mode
from server.access.certificates import Certificates, make_certificates
from tests.kit.sizes import in_ci
from tests.kit.wait import wait_until
from tests.server.live_robot import Pilot, live_server
from tests.server.own_process import own_process

from .broken_way import BrokenWay
from .world import PHONE, World, running_chromium

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.timeout(900)]
LAG_S = 6.0
"""How long a sentence may take to follow the truth, in seconds: the page asks once a second and
waits 2 s for an answer, on a machine that may be busy."""
STAY_S = 5.0
"""How long each fault lasts, in seconds, while nobody drives and while somebody does."""
SILENT_S = 2.0
"""How long a page may take a silent link for a working one, in seconds."""
NOTED_S = 0.5
"""How much later than the page a busy machine may note the truth, in seconds."""
WAYS = (
    *("refused", "no route", "asleep", "wrong port", "gateway", "websockets blocked"),
    *("captive portal, 200", "captive portal, 302", "captive portal, 401", "websockets cut"),
)
NO_ANSWER = {"refused", "no route", "asleep", "stopped", "TLS inspected"}
TRUE_IN: dict[str, set[str]] = {
    "out_of_reach": NO_ANSWER,
    "way.starting": {"stopped"},
    "way.gateway": {"gateway", "stopped"},
    "way.foreign": {*(way for way in WAYS if "portal" in way), "wrong port"},
    "way.blocked": {"websockets blocked", "CONNECT refused"},
    "way.cut": {"websockets cut"},
    "way.offline": {"offline"},
    "way.full": set(),
}
"""The conditions in which each sentence is true. The other sentences are not about a broken
path."""
_WHO = {"who.nobody": "stands", "who.other": "driven", "who.robot": "alone"}
_RECORD = """
  window.said = [];
  const shown = (name) => {
    const one = document.querySelector(name);
    return one && !one.hidden && one.offsetParent !== null ? one.innerText.trim() : '';
  };
  let last = '';
  const note = () => {
    const now = ['.notice p', '.who', 'app-bar'].map(shown);
    if (String(now) !== last) window.said.push([Date.now() / 1000, ...now]);
    last = String(now);
  };
  new MutationObserver(() => requestAnimationFrame(note)).observe(document, {
    subtree: true, childList: true, characterData: true, attributes: true,
    attributeFilter: ['hidden', 'class'],
  });
"""
_LINK = "document.querySelector('app-bar')?.page?.store.state.link"


def keys_of_sentences() -> dict[str, str]:
    """Return the English sentences by their texts; sentences with blanks are left out."""
    text = Path(__file__).parents[2].joinpath("web/js/messages/en.js").read_text("utf-8")
    found = re.findall(r"^  '?([\w.]+)'?: (['\"])(.*)\2,$", text, re.MULTILINE)
    return {said.replace("\\'", "'"): key for key, _, said in found}


class Log:
    """A condition, and the time since which it has held."""

    def __init__(self, first: str) -> None:
        self.entries = [(0.0, first)]

    def note(self, value: str) -> None:
        if value != self.entries[-1][1]:
            self.entries.append((time.time(), value))

    def between(self, from_s: float, to_s: float) -> set[str]:
        """Return all conditions that held at some moment of a time span, or were noted a little
        after it."""
        ends = [at_s for at_s, _ in self.entries[1:]] + [float("inf")]
        return {
            value
            for (at_s, value), end_s in zip(self.entries, ends, strict=True)
            if at_s <= to_s + NOTED_S and end_s >= from_s
        }


class Judge:
    """Compares the page's messages with the truth: the network path, and the robot's activity."""

    def __init__(self) -> None:
        self.way, self.doing = Log(""), Log("stands")
        self.sentences: dict[str, int] = {}
        self.false: list[str] = []
        self._keys = keys_of_sentences()

    def hear(self, page: Any) -> None:
        """Check everything that the page has said since it was opened, and forget it."""
        said = page.evaluate("window.said.splice(0, window.said.length - 1)")
        said += page.evaluate("window.said")
        end_s = time.time()
        for (at_s, sentence, who, _), (until_s, *_) in zip(said, [*said[1:], [end_s]], strict=True):
            key = self._keys.get(sentence, sentence)
            self.sentences[key] = self.sentences.get(key, 0) + 1
            ways = self.way.between(at_s - LAG_S, at_s)
            for wrong in self._wrong(key, who, at_s, until_s):
                self.false.append(
                    f"{sentence!r}/{who!r} for {until_s - at_s:.1f} s: {wrong} {ways}"
                )

    def _wrong(self, key: str, who: str, at_s: float, until_s: float) -> Iterator[str]:
        kind, _, doing = key.rpartition(".") if key.count(".") == 2 else (key, "", "")
        if kind in TRUE_IN:
            for moment_s in (at_s, until_s):
                if not TRUE_IN[kind] & self.way.between(moment_s - LAG_S, moment_s):
                    yield f"the way was {self.way.between(moment_s - LAG_S, moment_s)}"
        if kind in ("way.blocked", "way.cut"):
            for moment_s in (at_s, until_s):
                if doing not in self.doing.between(moment_s - LAG_S, moment_s):
                    since_s = [(round(at - moment_s, 1), what) for at, what in self.doing.entries]
                    yield f"the robot did something else: {since_s[-4:]}"
        is_open = bool({"", "websockets cut"} & self.way.between(at_s - SILENT_S, until_s))
        if who and not is_open:
            yield "nobody knows who drives"
        if who and _WHO.get(self._keys[who]) not in {None, *self.doing.between(at_s - LAG_S, at_s)}:
            yield "somebody else drives"
        if self._keys.get(who) == "who.pilot":
            yield "this page has never driven"


class Scene:
    """A robot, a broken path to it, somebody beside it who drives, and the truth."""

    def __init__(self, world: World, way: BrokenWay) -> None:
        self.world, self.road, self.judge = world, way, Judge()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()
        self.is_gone = False

    def _watch(self) -> None:
        while not self._ending.wait(0.02):
            decision = self.world.rig.loop.state.decision
            doing = {Mode.STOPPED: "stands", Mode.AUTONOMOUS: "alone"}.get(decision.mode, "driven")
            self.judge.doing.note(doing)

    def close(self) -> None:
        self._ending.set()
        self._thread.join()

    def become(self, fault: str, way: BrokenWay | None = None) -> None:
        road = way or self.road
        if fault:
            self.judge.way.note(fault)
            road.fault = fault
        else:
            road.fault = fault
            self.judge.way.note(fault)

    @contextlib.contextmanager
    def somebody_drives(self, page: Any) -> Iterator[None]:
        """Let another pilot drive past the broken path; the page keeps its messages."""
        with contextlib.closing(Pilot(self.world.address.replace("http", "ws") + "/ws/drive",
                                      sees=True)) as pilot:  # fmt: skip
            pilot.send(type="take")
            pilot.drive_until(lambda: self.world.mode is Mode.TRAIN, "left")
            yield
            pilot.hold(None)


def wait_for_link(page: Any, state: str) -> None:
    page.wait_for_function(f"() => {_LINK} === '{state}'")


@pytest.fixture
def scene(world: World) -> Iterator[Scene]:
    way = BrokenWay(int(world.address.rsplit(":", 1)[1]))
    there = Scene(world, way)
    yield there
    there.close()
    way.close()


def open_recorded(context: Any, address: str) -> Any:
    page = context.new_page()
    page.add_init_script(_RECORD)
    page.goto(address)
    return page


@in_ci
def test_no_sentence_about_a_broken_way_is_false(
    chromium: Any, scene: Scene, tmp_path: Path
) -> None:
    """Which sentence belongs to which fault is tested in Node (tests/web/way.test.mjs)."""
    context = chromium.new_context(viewport=PHONE, locale="en", service_workers="block")
    page = open_recorded(context, f"http://127.0.0.1:{scene.road.port}")
    wait_for_link(page, "open")
    judge = scene.judge
    for fault in WAYS:
        scene.become(fault)
        is_cut = fault == "websockets cut"
        page.wait_for_timeout(1000 * (4 * scene.road.cut_s if is_cut else STAY_S))
        with scene.somebody_drives(page):
            page.wait_for_timeout(1000 * (1.5 * scene.road.cut_s if is_cut else STAY_S))
        said = page.evaluate("window.said.slice(-1)[0]")
        print(f"{fault}: {said[1]!r}")
        scene.become("")
        wait_for_link(page, "open")
        judge.hear(page)
    a_device_without_network(context, page, scene)
    another_robot_and_its_end(page, scene, tmp_path)
    context.close()
    print(judge.sentences)
    assert not judge.false, "\n".join(judge.false)


def a_device_without_network(context: Any, page: Any, scene: Scene) -> None:
    """Only a page on another computer checks the device's network; this page needs no network."""
    scene.judge.way.note("refused")
    context.set_offline(True)
    scene.road.fault = "refused"
    page.wait_for_timeout(5000)
    context.set_offline(False)
    scene.become("")
    wait_for_link(page, "open")
    scene.judge.hear(page)


def another_robot_and_its_end(page: Any, scene: Scene, tmp_path: Path) -> None:
    """Another robot has the name now; then it is asleep, stopped, and started again."""
    with own_process(tmp_path / "twin") as twin:
        name = httpx.get(f"{twin.address}/api/state").json()["robot"]
        assert name != "Rover"
        scene.road.upstream = twin.port
        scene.become("refused")
        page.wait_for_timeout(1500)
        scene.become("")
        page.locator("app-bar", has_text=name).wait_for()
        scene.judge.hear(page)
        twin.process.send_signal(signal.SIGSTOP)
        scene.judge.way.note("asleep")
        page.wait_for_timeout(6000)
        twin.process.send_signal(signal.SIGCONT)
        scene.judge.way.note("")
        wait_for_link(page, "open")
        scene.judge.hear(page)
        scene.judge.way.note("stopped")
    page.wait_for_timeout(3000)
    with own_process(tmp_path / "twin") as twin:
        scene.road.upstream = twin.port
        scene.judge.way.note("")
        wait_for_link(page, "open")
        page.locator("app-bar", has_text=name).wait_for()
        scene.judge.hear(page)
        scene.judge.way.note("stopped")


def test_a_proxy_that_refuses_connect_is_named_and_pictures_come_by_requests(
    chromium: Any, scene: Scene
) -> None:
    proxy = BrokenWay(scene.road.upstream, as_proxy=True)
    options = {"server": f"http://127.0.0.1:{proxy.port}", "bypass": "<-loopback>"}
    context = chromium.new_context(
        viewport=PHONE, locale="en", service_workers="block", proxy=options
    )
    scene.become("CONNECT refused", proxy)
    page = open_recorded(context, scene.world.address)
    notice = page.locator(".notice", has_text="blocks live connections")
    notice.filter(has_text="The robot stands.").wait_for()
    notice.locator("button").click()
    still = "document.querySelector('img.still')?.naturalWidth"
    wait_until(lambda: page.evaluate(still) > 0, "a picture by request")
    with scene.somebody_drives(page):
        notice.filter(has_text="Somebody is driving.").wait_for()
        page.wait_for_timeout(500)
    scene.judge.hear(page)
    scene.become("gateway", proxy)
    page.locator(".notice", has_text="The proxy answers").wait_for()
    scene.judge.hear(page)
    scene.become("", proxy)
    wait_for_link(page, "open")
    scene.judge.hear(page)
    context.close()
    proxy.close()
    assert scene.judge.false == []


@in_ci
def test_a_box_that_looks_into_tls_is_no_robot_that_stands(tmp_path: Path) -> None:
    ours, theirs = (_certificates(tmp_path / name) for name in ("ours", "theirs"))
    inspecting = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    inspecting.load_cert_chain(theirs.chain, theirs.key)
    trusted = f"--ignore-certificate-errors-spki-list={_fingerprint(ours)}"
    judge = Judge()
    with live_server(certificates=ours) as server, running_chromium(trusted) as browser:
        way = BrokenWay(server.port, inspecting=inspecting)
        context = browser.new_context(viewport=PHONE, locale="en", service_workers="block")
        page = open_recorded(context, f"https://127.0.0.1:{way.port}")
        wait_for_link(page, "open")
        judge.way.note("TLS inspected")
        way.fault = "TLS inspected"
        page.locator(".notice", has_text="No answer").wait_for()
        page.wait_for_timeout(4000)
        judge.hear(page)
        way.fault = ""
        judge.way.note("")
        wait_for_link(page, "open")
        judge.hear(page)
        context.close()
        way.close()
    assert judge.false == []


def _certificates(folder: Path) -> Certificates:
    return make_certificates(folder, ["localhost", "127.0.0.1"], dt.datetime.now(dt.UTC))


def _fingerprint(certificates: Certificates) -> str:
    from cryptography import x509
    from cryptography.hazmat.primitives import serialization

    certificate = x509.load_pem_x509_certificate(certificates.chain.read_bytes())
    key = certificate.public_key().public_bytes(
        serialization.Encoding.DER, serialization.PublicFormat.SubjectPublicKeyInfo
    )
    return base64.b64encode(hashlib.sha256(key).digest()).decode()
