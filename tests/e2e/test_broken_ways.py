"""The page's sentences on a broken network path, in a real Chromium, compared with the truth.

Which sentence belongs to which fault is tested in Node, too (tests/web/way.test.mjs).
"""

from __future__ import annotations

import base64
import contextlib
import datetime as dt
import hashlib
import re
import signal
import ssl
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from robot.types import Mode
from server.access.certificates import Certificates, make_certificates
from tests.kit.sizes import only_full
from tests.kit.wait import wait_until
from tests.server.live_robot import Pilot, live_server
from tests.server.own_process import own_process

from .broken_way import BrokenWay
from .test_holds_still import messages
from .world import PHONE, World, running_chromium

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.timeout(900)]
WAYS = {
    **dict.fromkeys(("refused", "no route", "asleep"), "out_of_reach"),
    "wrong port": "way.foreign",
    **dict.fromkeys((f"captive portal, {status}" for status in (200, 302, 401)), "way.foreign"),
    "gateway": "way.gateway",
    "websockets blocked": "way.blocked",
    "websockets cut": "way.cut",
}
"""Each fault, and the only sentence about a broken path that is true in it."""
ENGLISH = messages("en")
SENTENCES = {ENGLISH[key]: key for key in ENGLISH if re.match("way[.]|out_of_reach", key)}
"""The keys of the sentences about a broken path."""
_RECORD = """
  window.said = [];
  const note = () => {
    const one = document.querySelector('.notice p');
    const text = one?.offsetParent ? one.innerText.trim() : '';
    if (text !== window.said.at(-1)) window.said.push(text);
  };
  new MutationObserver(() => requestAnimationFrame(note)).observe(document, {
    subtree: true, childList: true, characterData: true, attributes: true,
    attributeFilter: ['hidden', 'class'],
  });
"""


class Listener:
    """A page, and all that it has said since it was last asked."""

    def __init__(self, context: Any, address: str) -> None:
        self.page = context.new_page()
        self.page.add_init_script(_RECORD)
        self.page.goto(address)

    def wait_for_link(self) -> None:
        link = "document.querySelector('app-bar')?.page?.store.state.link"
        self.page.wait_for_function(f"() => {link} === 'open'")

    def wait_for(self, key: str, doing: str = "stands") -> None:
        """Wait until it shows a sentence, with the robot's activity if the sentence names it."""
        text = ENGLISH.get(key) or ENGLISH[f"{key}.{doing}"]
        self.page.locator(".notice p", has_text=text).wait_for()
        assert not self.page.locator(".who:visible").count(), "nobody knows who drives"

    def said(self) -> set[str]:
        """Return the sentences about a broken path, without the robot's activity."""
        keys = [SENTENCES.get(text, "") for text in self.page.evaluate("said.splice(0)")]
        return {re.sub(r"[.](stands|driven|alone)$", "", key) for key in keys} - {""}


@contextlib.contextmanager
def somebody_drives(world: World) -> Iterator[None]:
    """Let another pilot drive past the broken path."""
    url = world.address.replace("http", "ws") + "/ws/drive"
    with contextlib.closing(Pilot(url, sees=True)) as pilot:
        pilot.send(type="take")
        pilot.drive_until(lambda: world.mode is Mode.TRAIN, "left")
        yield
        pilot.hold(None)


@pytest.fixture
def way(world: World) -> Iterator[BrokenWay]:
    way = BrokenWay(int(world.address.rsplit(":", 1)[1]))
    yield way
    way.close()


@only_full
def test_no_sentence_about_a_broken_way_is_false(
    chromium: Any, world: World, way: BrokenWay, tmp_path: Path
) -> None:
    context = chromium.new_context(viewport=PHONE, locale="en", service_workers="block")
    listener = Listener(context, way.address)
    listener.wait_for_link()
    for fault, sentence in WAYS.items():
        way.fault = fault
        listener.wait_for(sentence)
        with somebody_drives(world):
            listener.wait_for(sentence, "driven")
        way.fault = ""
        listener.wait_for_link()
        assert listener.said() == {sentence}, fault
    # Only a page on another computer needs the device's network.
    context.set_offline(True)
    way.fault = "refused"
    listener.wait_for("out_of_reach")
    context.set_offline(False)
    way.fault = ""
    listener.wait_for_link()
    another_robot_and_its_end(listener, way, tmp_path / "twin")
    context.close()


def another_robot_and_its_end(listener: Listener, way: BrokenWay, folder: Path) -> None:
    """Another robot has the address now; then it is asleep, ended, and started again."""
    with own_process(folder) as twin:
        name = httpx.get(f"{twin.address}/api/state").json()["robot"]
        way.upstream = twin.port
        way.fault = "refused"
        way.fault = ""
        listener.page.locator("app-bar", has_text=name).wait_for()
        twin.process.send_signal(signal.SIGSTOP)
        listener.wait_for("out_of_reach")
        twin.process.send_signal(signal.SIGCONT)
        listener.wait_for_link()
    listener.wait_for("out_of_reach")
    with own_process(folder) as twin:
        way.upstream = twin.port
        listener.wait_for_link()
        listener.page.locator("app-bar", has_text=name).wait_for()
    assert listener.said() <= {"out_of_reach", "way.gateway", "way.starting"}


def test_a_proxy_that_refuses_connect_is_named_and_pictures_come_by_requests(
    chromium: Any, world: World
) -> None:
    proxy = BrokenWay(int(world.address.rsplit(":", 1)[1]), as_proxy=True)
    proxy.fault = "CONNECT refused"
    options = {"server": proxy.address, "bypass": "<-loopback>"}
    context = chromium.new_context(
        viewport=PHONE, locale="en", service_workers="block", proxy=options
    )
    listener = Listener(context, world.address)
    listener.wait_for("way.blocked")
    listener.page.locator(".notice button").click()
    still = "document.querySelector('img.still')?.naturalWidth"
    wait_until(lambda: listener.page.evaluate(still) > 0, "a picture by request")
    with somebody_drives(world):
        listener.wait_for("way.blocked", "driven")
    assert listener.said() == {"way.blocked"}
    proxy.fault = "gateway"
    listener.wait_for("way.gateway")
    proxy.fault = ""
    listener.wait_for_link()
    context.close()
    proxy.close()


@only_full
def test_a_proxy_that_intercepts_tls_is_not_shown_as_a_standing_robot(tmp_path: Path) -> None:
    ours, theirs = (_certificates(tmp_path / name) for name in ("ours", "theirs"))
    inspecting = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    inspecting.load_cert_chain(theirs.chain, theirs.key)
    trusted = f"--ignore-certificate-errors-spki-list={_fingerprint(ours)}"
    with live_server(certificates=ours) as server, running_chromium(trusted) as browser:
        way = BrokenWay(server.port, inspecting=inspecting)
        context = browser.new_context(viewport=PHONE, locale="en", service_workers="block")
        listener = Listener(context, f"https://127.0.0.1:{way.port}")
        listener.wait_for_link()
        way.fault = "TLS inspected"
        listener.wait_for("out_of_reach")
        way.fault = ""
        listener.wait_for_link()
        assert listener.said() == {"out_of_reach"}
        context.close()
        way.close()


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
