"""Addresses, names and the wall clock may change while the server runs, and it follows them."""

from __future__ import annotations

import datetime as dt
import secrets
import socket
import ssl
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import pytest

from robot.testing import VirtualClock
from server.access.announcement import Announcement
from server.access.certificates import RenewedCertificates
from server.access.config import NetworkConfig
from server.access.gateway import NetworkGateway
from server.access.network import lan_addresses, names_in_network, page_addresses
from server.access.pairing import Pairing
from server.access.surroundings import CLAIM_EVERY_S, LOOK_EVERY_S, Surroundings, Watch
from server.access.unknown_name import explain_unknown_name
from server.gateway.roles import Role
from server.gateway.rules import check_host
from server.hosting.serving import open_sockets
from tests.kit.wait import wait_until

from .test_certificates import handshake, serving

LAN = NetworkConfig(host="::", lan=True, port=8000)


class Network:
    """The machine's surroundings; the tests change `there` and `names`."""

    def __init__(self, *there: str) -> None:
        self.there, self.names = list(there), list[str]()
        self.claimed: list[tuple[str, ...]] = []
        self.hostname = "drivelesson"

    def claim(self, addresses: Sequence[str]) -> str:
        self.claimed.append(tuple(addresses))
        return self.hostname

    def surroundings(self, config: NetworkConfig = LAN) -> Surroundings:
        return Surroundings(
            config,
            addresses=lambda _: list(self.there),
            ask_names=lambda *_: list(self.names),
            claim=self.claim,
        )


def test_an_address_that_comes_late_is_announced_and_shown(
    capsys: pytest.CaptureFixture[str],
) -> None:
    network = Network()
    around = network.surroundings()
    shown: list[str] = []
    pairing = Pairing(10)
    gateway = NetworkGateway(LAN, VirtualClock(), pairing, around)
    gateway._show = shown.append
    gateway.serving(list).__enter__()
    around.look()
    assert around.page_addresses == ["http://drivelesson.local:8000"]
    network.there = ["192.168.1.7"]
    assert around.look()
    assert network.claimed == [(), ("192.168.1.7",)]
    code = f"http://192.168.1.7:8000/pair#{pairing.tokens[Role.PILOT]}"
    assert code in capsys.readouterr().out and shown == [code]
    assert not around.look() and not capsys.readouterr().out, "said once"
    network.there, network.hostname = ["192.168.1.9", "fd99::1"], "drivelesson-2"
    around.look()
    out = capsys.readouterr().out
    assert "this one is drivelesson-2.local" in out and "http://[fd99::1]:8000" in out
    assert "drivelesson-2.local" in around and "drivelesson.local" not in around


def test_the_watch_looks_again_and_outlives_a_network_that_fails() -> None:
    looks = 0

    def look(_: NetworkConfig) -> list[str]:
        nonlocal looks
        looks += 1
        if looks == 3:
            raise OSError("no such device")
        return ["10.0.0.1"] if looks > 4 else []

    clock = VirtualClock()
    around = Surroundings(LAN, addresses=look, ask_names=lambda *_: [], claim=lambda _: "x")
    ended = SimpleNamespace(n=0)

    def wait(event: Any, timeout_s: float | None = None) -> bool:
        ended.n += 1
        clock.advance(timeout_s or 0.0)
        if ended.n == 6:
            event.set()
        return bool(event.is_set())

    watch = Watch(around, clock)
    with mock.patch.object(clock, "wait", wait):
        watch._run()
    assert around.now.addresses == ("10.0.0.1",) and clock.now_s() == 6 * LOOK_EVERY_S


@pytest.mark.parametrize(
    ("asked", "is_known"),
    [
        ("rover.fritz.box", True),
        ("rover.school.example", True),
        ("robot_1", True),
        ("drivelesson", True),
        ("printer.school.example", True),
        ("localhost", True),
        ("evil.example", False),
        ("drivelesson.local.evil.example", False),
        ("rover.fritz.box.evil.example", False),
        ("rover.evil.example", False),
        ("", False),
    ],
)
def test_the_robot_answers_only_to_names_that_the_network_gives_it(
    asked: str, is_known: bool
) -> None:
    network = Network("192.168.178.20")
    network.names = ["rover.fritz.box", "rover.school.example", "printer.school.example"]
    around = network.surroundings()
    around.ask(0.0)
    gateway = NetworkGateway(LAN, VirtualClock(), surroundings=around)
    refusal = check_host(gateway, {"host": f"{asked}:8000"})
    assert (refusal is None) is is_known
    if refusal is not None:
        assert "http://192.168.178.20:8000" in refusal.sentence


def test_without_lan_the_robot_does_not_answer_to_a_name_without_a_dot() -> None:
    around = Surroundings(NetworkConfig(also_at=("rover.test",)))
    assert "rover.test" in around and "localhost" in around
    assert "robot" not in around


def test_the_resolver_gives_this_machines_names_in_the_network(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "resolv.conf"
    file.write_text("# made by dhcp\ndomain old.example\nsearch Fritz.Box school.example local\n")
    monkeypatch.setattr(socket, "gethostname", lambda: "Rover")
    asked: list[str] = []

    def ask(address: str) -> tuple[str, list[str], list[str]]:
        asked.append(address)
        if ":" in address:
            raise OSError("no answer")
        return "lab-7.school.example.", ["lab <7>"], []

    monkeypatch.setattr(socket, "gethostbyaddr", ask)
    names = names_in_network("drivelesson", ["10.1.1.7", "fd00::7"], file)
    assert {"rover", "rover.local", "rover.fritz.box", "lab-7.school.example"} <= set(names)
    assert "drivelesson.school.example" in names and "rover.old.example" not in names
    assert not [name for name in names if "<" in name] and asked == ["10.1.1.7", "fd00::7"]
    monkeypatch.setattr(socket, "gethostname", lambda: "penguin")
    assert "penguin.linux.test" in names_in_network("drivelesson", [], tmp_path / "none")


@pytest.mark.parametrize("accepted", ["en-GB,en;q=0.9", "es-ES", "zh-CN,zh", "fr"])
def test_a_browser_at_an_unknown_name_is_led_to_the_address(accepted: str) -> None:
    page = explain_unknown_name("a<b>.example", ["http://10.0.0.2:8000"], accepted).decode()
    assert '<a href="http://10.0.0.2:8000/">' in page and "--also-at a&lt;b&gt;" in page
    assert f'lang="{accepted[:2] if accepted != "fr" else "en"}"' in page


NEW_YEAR = dt.datetime(1970, 1, 1, 0, 5, tzinfo=dt.UTC)
NOW = dt.datetime(2026, 9, 1, tzinfo=dt.UTC)


def test_a_certificate_of_1970_is_renewed_when_the_clock_is_set(tmp_path: Path) -> None:
    made = RenewedCertificates(tmp_path, ["drivelesson.local"], NEW_YEAR)
    server, anybody = serving(made.files), ssl.create_default_context()
    anybody.check_hostname, anybody.verify_mode = False, ssl.CERT_NONE
    made.use(server)
    authority = made.files.authority.read_bytes()
    before = handshake(anybody, server)
    assert made.renew(["drivelesson.local"], NEW_YEAR) is None
    assert made.renew(["drivelesson.local"], NOW) == "the clock was set"
    assert handshake(anybody, server) != before, "in the context that serves"
    assert made.renew(["drivelesson.local"], NOW) is None
    assert made.renew(["drivelesson.local", "192.168.1.7"], NOW) == "names or addresses changed"
    assert made.renew(["drivelesson.local", "192.168.1.7"], NOW + dt.timedelta(days=380))
    assert made.renew(["drivelesson.local", "192.168.1.7"], NEW_YEAR), "back again"
    assert made.files.authority.read_bytes() == authority, "phones trust that one"


@pytest.fixture
def default_name(monkeypatch: pytest.MonkeyPatch) -> str:
    """The name of a robot that nobody named, different in each test: all share one loopback."""
    if not hasattr(pytest.importorskip("zeroconf"), "AddressResolver"):
        pytest.skip("this zeroconf cannot ask for a host's addresses")
    name = f"drivelesson-{secrets.token_hex(4)}"
    monkeypatch.setattr("server.access.announcement.DEFAULT_HOSTNAME", name)
    return name


def two_addresses() -> tuple[str, str]:
    """Two of the loopback that no other process has, the lower one first."""
    first = f"127.{secrets.randbelow(250) + 2}.{secrets.randbelow(250)}"
    return f"{first}.2", f"{first}.3"


def test_of_two_robots_that_nobody_named_the_second_takes_another_name(default_name: str) -> None:
    chosen = f"ada-{default_name}"
    one, two, named = (
        Announcement(NetworkConfig(lan=True, port=8130 + i, hostname=name), "Ada")
        for i, name in enumerate([default_name, default_name, chosen])
    )
    first, second = two_addresses()
    try:
        assert one.announce([first]) == default_name
        assert two.announce([second]) == f"{default_name}-2"
        assert two.announce([second]) == f"{default_name}-2", "it keeps it"
        assert named.announce([second]) == chosen
    finally:
        for each in (one, two, named):
            each.close()


@pytest.mark.realtime
def test_of_two_robots_that_start_at_the_same_moment_the_second_gives_way(
    default_name: str,
) -> None:
    config = NetworkConfig(lan=True, port=8135, hostname=default_name)
    places = two_addresses()
    robots = [Announcement(config, "Ada") for _ in places]
    try:
        for robot, place in zip(robots, places, strict=True):
            with mock.patch.object(robot, "_free_name", lambda _: default_name):
                robot.announce([place])  # neither hears the other one
        first, second = robots
        wait_until(lambda: second.must_yield([places[1]]), "the second hears the first")
        wait_until(lambda: not first.must_yield([places[0]]), "the first keeps the name")
        assert second.announce([places[1]]) == f"{default_name}-2"
        assert not second.must_yield([places[1]])
    finally:
        for robot in robots:
            robot.close()


def test_the_computers_own_name_may_change_and_a_taken_name_is_given_up_while_it_serves() -> None:
    network, taken = Network("10.0.0.1"), [False]
    around = Surroundings(
        LAN,
        addresses=lambda _: ["10.0.0.1"],
        ask_names=lambda *_: [f"{socket.gethostname()}.school.example"],
        claim=network.claim,
        is_taken=lambda _: taken[0],
    )
    with mock.patch("socket.gethostname", lambda: "old"):
        around.look(0.0)
        around.ask(0.0)
    assert "old.local" in around and "old.school.example" in around
    with mock.patch("socket.gethostname", lambda: "new"):
        assert around.look(1.0)
        around.ask(1.0)
        assert "new.local" in around and "new.school.example" in around
        assert "old.local" not in around and len(network.claimed) == 1
        taken[0], network.hostname = True, "drivelesson-2"
        assert not around.look(2.0), "it is asked every ten seconds"
        assert around.look(1.0 + CLAIM_EVERY_S) and "drivelesson-2.local" in around


def test_addresses_of_six_are_announced_and_served() -> None:
    pytest.importorskip("zeroconf")
    config = NetworkConfig(lan=True, host="fd99::1", port=8140)
    service = Announcement(config, "Ada")._service(lan_addresses(config))
    assert service.parsed_addresses() == ["fd99::1"]
    assert page_addresses(config)[0] == "http://[fd99::1]:8140"
    listeners = open_sockets("::", 0)
    ports = {listener.getsockname()[1] for listener in listeners}
    families = {listener.family for listener in listeners}
    for listener in listeners:
        listener.close()
    assert len(ports) == 1 and socket.AF_INET in families
    if socket.has_ipv6 and _has_six():
        assert families == {socket.AF_INET, socket.AF_INET6}


def _has_six() -> bool:
    try:
        with socket.create_server(("::1", 0), family=socket.AF_INET6):
            return True
    except OSError:
        return False
