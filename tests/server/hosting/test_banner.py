"""The banner on the terminal, and the name on the network."""

from __future__ import annotations

import contextlib
import io
import logging
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from server.access.announcement import announced
from server.access.banner import greet_phones
from server.access.config import NetworkConfig, PublicAddress
from server.access.gateway import NetworkGateway
from server.access.pairing import Paired
from server.access.terminal_code import draw_qr
from server.board.discovery import browsing
from server.board.transport import RobotAddress
from server.gateway.roles import Role
from server.hosting.logs import OneLine, start_logging


def test_phones_are_greeted_with_a_code_and_addresses_for_both_rights() -> None:
    tokens = {Role.PILOT: "PPPP-PPPP", Role.VIEWER: "VVVV-VVVV"}
    text = greet_phones(["http://192.0.2.1:8000", "http://drivelesson.local:8000"], tokens, [])
    assert "http://192.0.2.1:8000/pair#PPPP-PPPP" in text
    assert "http://192.0.2.1:8000/pair#VVVV-VVVV" in text
    assert "http://drivelesson.local:8000" in text
    assert draw_qr("http://192.0.2.1:8000/pair#PPPP-PPPP") in text.replace("\n\n  or", "\n  or")


def test_without_segno_a_line_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "segno", None)
    assert "drivelesson[lan]" in draw_qr("anything")


def test_without_zeroconf_the_extra_is_named_and_the_robot_drives(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setitem(sys.modules, "zeroconf", None)
    with announced(NetworkConfig(hostname="r", lan=True), "Ada"):
        assert "the name r.local needs drivelesson[lan]" in caplog.text


@pytest.mark.parametrize("address", ["raspberrypi", ""])
def test_a_machine_without_an_ipv4_address_starts_without_a_name(
    address: str, caplog: pytest.LogCaptureFixture
) -> None:
    pytest.importorskip("zeroconf")
    with announced(NetworkConfig(host=address, lan=True), "Ada"):
        assert "mdns off" in caplog.text


def test_two_robots_announce_themselves_and_the_board_finds_both() -> None:
    zeroconf = pytest.importorskip("zeroconf")
    kind, here = "_http._tcp.local.", ["127.0.0.1"]
    both = {RobotAddress("127.0.0.1", 8123), RobotAddress("127.0.0.1", 8124, is_tls=True)}
    found: set[RobotAddress] = set()
    is_complete = threading.Event()

    def note(address: RobotAddress) -> None:
        found.add(address)
        if both <= found:
            is_complete.set()

    with (
        announced(NetworkConfig(port=8123, lan=True, hostname="ada-test"), "Ada"),
        announced(NetworkConfig(port=8124, lan=True, hostname="bolt-test", tls=True), "Bolt"),
        browsing(note, here),
        contextlib.closing(zeroconf.Zeroconf(interfaces=here)) as asker,
    ):
        is_complete.wait()  # the test's own time limit ends it
        info = asker.get_service_info(kind, f"Drivelesson ada-test.{kind}", 10_000)
    assert info is not None
    assert (info.server, info.port) == ("ada-test.local.", 8123)
    assert info.parsed_addresses() == here


def test_only_the_logs_thread_waits_for_the_terminal(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A paused terminal would hold up the control loop, which logs each stop."""
    terminal, writers, at_exit = io.StringIO(), set[str](), []
    write = terminal.write

    def note(text: str) -> int:
        writers.add(threading.current_thread().name)
        return write(text)

    monkeypatch.setattr(terminal, "write", note)
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(logging.root, "handlers", [])
    monkeypatch.setattr(logging.root, "level", logging.INFO)
    monkeypatch.setattr("atexit.register", at_exit.append)
    start_logging(verbose=False)
    for number in range(7):
        logging.getLogger("robot.control").warning("stop reason=%s", number)
    try:
        raise ValueError("two\nlines")
    except ValueError:
        logging.getLogger("robot.control").exception("it failed")
    for end in at_exit:
        end()
    assert threading.current_thread().name not in writers
    lines = terminal.getvalue().splitlines()
    assert len(lines) == 5 + 1, "the sixth of a kind is left out, and a traceback is one line"
    assert " WARNING robot.control stop reason=4" in lines[4]
    assert "it failed" in lines[5]
    assert "two\\nlines" in lines[5]


HERE = PublicAddress.parse("http://10.0.0.2:8000")


def test_a_paused_terminal_does_not_delay_a_phone_that_pairs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The event loop would wait for the terminal, and every STOP with it."""
    threads: list[Callable[[], None]] = []
    shown: list[str] = []
    clock = SimpleNamespace(start_thread=lambda target, _: threads.append(target))
    gateway = NetworkGateway(NetworkConfig(public=(HERE,), data=tmp_path), clock)  # type: ignore[arg-type]
    gateway.open("Ada", shown.append)
    pairing = gateway.pairing
    assert pairing is not None
    assert isinstance(pairing.redeem(pairing.tokens[Role.PILOT], 0.0), Paired)
    assert not capsys.readouterr().out
    for thread in threads:
        thread()
    assert pairing.tokens[Role.PILOT] in capsys.readouterr().out
    assert shown[-1].endswith(pairing.tokens[Role.PILOT])


def test_text_from_a_client_cannot_forge_a_line_of_the_log() -> None:
    record = logging.LogRecord("x", logging.INFO, "", 0, "path=%s", ("a\nb\rc",), None)
    assert OneLine("%(message)s").format(record) == "path=a\\nb\\rc"
