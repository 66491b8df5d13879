"""The robot announces and shows its names and addresses, and notices when they change."""

import contextlib
import itertools
import secrets
import socket
import subprocess
import sys
import threading
from collections.abc import Sequence
from unittest import mock

import pytest

from robot.store.lock import FolderLock
from robot.testing import VirtualClock
from server.access.announcement import Announcement, announced
from server.access.banner import greet_phones
from server.access.config import NetworkConfig, PublicAddress
from server.access.gateway import NetworkGateway
from server.access.network import lan_addresses, names_in_network, own_addresses, page_addresses
from server.access.pairing import Paired, Pairing
from server.access.surroundings import CLAIM_EVERY_S, LOOK_EVERY_S, Surroundings, Watch
from server.access.terminal_code import draw_qr
from server.access.unknown_name import explain_unknown_name
from server.board.discovery import browsing
from server.board.transport import RobotAddress
from server.gateway.roles import Role
from server.gateway.rules import check_host
from server.hosting.serving import open_sockets
from tests.kit.wait import wait_until

LAN = NetworkConfig(host="::", lan=True, port=8000)


class Network:
    """The machine's surroundings; the tests change `there`, `names`, `hostname` and `is_taken`."""

    def __init__(self, *there: str) -> None:
        self.there, self.names = list(there), list[str]()
        self.claimed: list[tuple[str, ...]] = []
        self.hostname, self.is_taken = "drivelesson", False
        self.around = Surroundings(
            LAN,
            addresses=lambda _: list(self.there),
            ask_names=lambda *_: [*self.names, f"{socket.gethostname()}.school.example"],
            claim=self.claim,
            is_taken=lambda _: self.is_taken,
        )

    def claim(self, addresses: Sequence[str]) -> str:
        self.claimed.append(tuple(addresses))
        return self.hostname


def test_an_address_that_comes_late_is_announced_and_shown(capsys):
    network, pairing = Network(), Pairing(10)
    around, shown = network.around, list[str]()
    gateway = NetworkGateway(LAN, VirtualClock(), pairing, around)
    gateway._show = shown.append
    gateway._follow_changes()
    around.look()
    assert around.page_addresses == ["http://drivelesson.local:8000"]
    network.there = ["192.168.1.7"]
    assert around.look()
    assert network.claimed == [(), ("192.168.1.7",)]
    code = f"http://192.168.1.7:8000/pair#{pairing.tokens[Role.PILOT]}"
    assert code in capsys.readouterr().out and shown == [code]
    assert not around.look() and not capsys.readouterr().out, "the address is printed only once"
    network.there, network.hostname = ["192.168.1.9", "fd99::1"], "drivelesson-2"
    around.look()
    out = capsys.readouterr().out
    assert "this one is drivelesson-2.local" in out and "http://[fd99::1]:8000" in out
    assert "drivelesson-2.local" in around and "drivelesson.local" not in around


def test_the_computers_own_name_may_change_and_a_taken_name_is_given_up_while_it_serves():
    network = Network("10.0.0.1")
    around = network.around
    with mock.patch("socket.gethostname", lambda: "old"):
        around.look(0.0)
        around.ask(0.0)
    assert "old.local" in around and "old.school.example" in around
    with mock.patch("socket.gethostname", lambda: "new"):
        assert around.look(1.0)
        around.ask(1.0)
        assert "new.local" in around and "new.school.example" in around
        assert "old.local" not in around and len(network.claimed) == 1
        network.is_taken, network.hostname = True, "drivelesson-2"
        assert not around.look(2.0), "the address is looked up only every ten seconds"
        assert around.look(1.0 + CLAIM_EVERY_S) and "drivelesson-2.local" in around


def test_the_watch_looks_again_and_outlives_a_network_that_fails():
    looks = iter([[], [], OSError("no such device"), [], *[["10.0.0.1"]] * 9])

    def look(_):
        found = next(looks)
        if isinstance(found, OSError):
            raise found
        return found

    clock = VirtualClock()
    around = Surroundings(LAN, addresses=look, ask_names=lambda *_: ["x.example"])
    watch = Watch(around, clock)
    watch.start()
    clock.sleep(5.5 * LOOK_EVERY_S)
    watch.stop()
    assert (around.now.addresses, around.now.names) == (("10.0.0.1",), ("x.example",))


@pytest.mark.parametrize(
    ("asked", "is_known"),
    [
        *(("rover.fritz.box", True), ("printer.school.example", True), ("localhost", True)),
        *(("robot_1", True), ("drivelesson", True), ("drivelesson.local", True)),
        ("10.1.1.1", True),  # every IP address is accepted
        *(("evil.example", False), ("drivelesson.local.evil.example", False)),
        *(("rover.fritz.box.evil.example", False), ("rover.evil.example", False), ("", False)),
    ],
)
def test_the_robot_answers_only_to_names_that_the_network_gives_it(asked, is_known):
    network = Network("192.168.178.20")
    network.names = ["rover.fritz.box", "printer.school.example"]
    network.around.ask(0.0)
    gateway = NetworkGateway(LAN, VirtualClock(), surroundings=network.around)
    refusal = check_host(gateway, {"host": f"{asked}:8000"})
    assert (refusal is None) is is_known
    if refusal is not None:
        assert "http://192.168.178.20:8000" in refusal.sentence


def test_without_lan_the_robot_does_not_answer_to_a_name_without_a_dot():
    around = Surroundings(NetworkConfig(also_at=("rover.test",)))
    assert "rover.test" in around and "localhost" in around
    assert "robot" not in around


def test_the_resolver_gives_this_machines_names_in_the_network(tmp_path, monkeypatch):
    file = tmp_path / "resolv.conf"
    file.write_text("# made by dhcp\ndomain old.example\nsearch Fritz.Box school.example local\n")
    monkeypatch.setattr(socket, "gethostname", lambda: "Rover")
    asked: list[str] = []

    def ask(address):
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


@pytest.mark.parametrize(
    ("accepted", "language"),
    [("en-GB,en;q=0.9", "en"), ("es-ES", "es"), ("zh-CN,zh", "zh"), ("fr", "en")],
)
def test_a_browser_at_an_unknown_name_is_led_to_the_address(accepted, language):
    page = explain_unknown_name("a<b>.example", ["http://10.0.0.2:8000"], accepted).decode()
    assert '<a href="http://10.0.0.2:8000/">' in page and "--also-at a&lt;b&gt;" in page
    assert f'lang="{language}"' in page


@pytest.mark.realtime
def test_of_two_robots_that_nobody_named_the_second_takes_another_name(monkeypatch):
    """Two robots also get different names if they start at the same moment."""
    if not hasattr(pytest.importorskip("zeroconf"), "AddressResolver"):
        pytest.skip("this version of zeroconf cannot resolve a host's addresses")
    # The name and addresses belong only to this test, because all processes share the loopback.
    name = f"drivelesson-{secrets.token_hex(4)}"
    monkeypatch.setattr("server.access.announcement.DEFAULT_HOSTNAME", name)
    net = f"127.{secrets.randbelow(250) + 2}.{secrets.randbelow(250)}"
    low, high = [f"{net}.2"], [f"{net}.3"]
    with contextlib.ExitStack() as stack:

        def robot(hostname):
            config = NetworkConfig(lan=True, port=8130, hostname=hostname)
            return stack.enter_context(contextlib.closing(Announcement(config, "Ada")))

        first, second, third, named = map(robot, (name, name, name, f"ada-{name}"))
        for one, place in ((first, low), (second, high)):
            with mock.patch.object(one, "_free_name", lambda _: name):
                one.announce(place)  # neither robot knows of the other
        wait_until(lambda: second.must_yield(high), "the second hears the first")
        wait_until(lambda: not first.must_yield(low), "the first keeps the name")
        for _ in range(2):
            assert second.announce(high) == f"{name}-2", "the second robot keeps its new name"
        assert not second.must_yield(high)
        assert third.announce([f"{net}.4"]) == f"{name}-3"
        assert named.announce(high) == f"ada-{name}"


def test_the_address_in_a_vpn_comes_last(monkeypatch):
    """A VPN often routes the whole internet, so the system prefers the VPN's address."""

    def prefer_the_tunnel(probe, address):
        probe.bind(("127.66.0.2", 0))

    ifaddr = pytest.importorskip("ifaddr")
    adapters = [
        ifaddr.Adapter(name, name, [ifaddr.IP(address, prefix, name)])
        for name, address, prefix in (("tun0", "127.66.0.2", 32), ("wlan0", "192.168.7.5", 24))
    ]
    monkeypatch.setattr(ifaddr, "get_adapters", lambda: adapters)
    monkeypatch.setattr(socket.socket, "connect", prefer_the_tunnel)
    assert own_addresses() == ["192.168.7.5", "127.66.0.2"]


def test_two_robots_announce_themselves_and_the_board_finds_both():
    """The board's computer gets its address only after the board has started."""
    zeroconf = pytest.importorskip("zeroconf")
    kind, here = "_http._tcp.local.", ["127.0.0.1"]
    both = {RobotAddress("127.0.0.1", 8123), RobotAddress("127.0.0.1", 8124, is_tls=True)}
    found, is_complete = set[RobotAddress](), threading.Event()
    own = itertools.chain([[]], itertools.repeat(here))

    def note(address):
        found.add(address)
        if both <= found:
            is_complete.set()

    with (
        announced(NetworkConfig(port=8123, lan=True, hostname="ada-test"), "Ada"),
        announced(NetworkConfig(port=8124, lan=True, hostname="bolt-test", tls=True), "Bolt"),
        browsing(note, lambda: next(own)),
        contextlib.closing(zeroconf.Zeroconf(interfaces=here)) as asker,
    ):
        is_complete.wait()  # the test's own time limit ends this loop
        info = asker.get_service_info(kind, f"Drivelesson ada-test.{kind}", 10_000)
    assert (info.server, info.port) == ("ada-test.local.", 8123)
    assert info.parsed_addresses() == here


def test_a_robot_that_ends_by_an_error_before_it_serves_is_no_longer_announced(tmp_path):
    zeroconf = pytest.importorskip("zeroconf")
    here = f"127.{secrets.randbelow(250) + 2}.{secrets.randbelow(250)}.2"
    robot, heard, is_gone = secrets.token_hex(4), list[str](), threading.Event()

    def note(zeroconf, service_type, name, state_change):
        if robot in name:  # other tests announce robots, too
            heard.append(state_change.name)
        if heard[-1:] == ["Removed"]:
            is_gone.set()

    words = ["serve", "--lan", "--host", here, "--port", "0", "--data", str(tmp_path)]
    words += ["--hostname", f"robot-{robot}"]
    lock = FolderLock(tmp_path)
    with contextlib.closing(zeroconf.Zeroconf(interfaces=[here])) as asker:
        zeroconf.ServiceBrowser(asker, "_http._tcp.local.", handlers=[note])
        lock.start()
        command = [sys.executable, "-m", "server", *words]
        ended = subprocess.run(command, capture_output=True, text=True, check=False)
        lock.stop()
        assert ended.returncode == 1 and "uses the data folder" in ended.stderr
        is_gone.wait()  # the test's own time limit ends this wait
    assert heard == ["Added", "Removed"]


@pytest.mark.parametrize("address", ["raspberrypi", ""])
def test_a_machine_without_an_address_or_zeroconf_starts_without_a_name(
    address, monkeypatch, caplog
):
    pytest.importorskip("zeroconf")
    with announced(NetworkConfig(host=address, lan=True), "Ada"):
        assert "mdns off" in caplog.text
    monkeypatch.setitem(sys.modules, "zeroconf", None)
    with announced(NetworkConfig(hostname="r", lan=True), "Ada"):
        assert "the name r.local needs drivelesson[lan]" in caplog.text


def test_ipv6_addresses_are_announced_and_served():
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
    with contextlib.suppress(OSError):  # the machine has no IPv6
        socket.create_server(("::1", 0), family=socket.AF_INET6).close()
        assert families == {socket.AF_INET, socket.AF_INET6}


def test_phones_are_greeted_with_a_code_and_addresses_for_both_rights():
    tokens = {Role.PILOT: "PPPP-PPPP", Role.VIEWER: "VVVV-VVVV"}
    text = greet_phones(["http://192.0.2.1:8000", "http://drivelesson.local:8000"], tokens, [])
    assert "http://192.0.2.1:8000/pair#VVVV-VVVV" in text
    assert "http://drivelesson.local:8000" in text
    assert draw_qr("http://192.0.2.1:8000/pair#PPPP-PPPP") in text.replace("\n\n  or", "\n  or")


def test_a_paused_terminal_does_not_delay_a_phone_that_pairs(tmp_path, capsys):
    """If the event loop waited for the terminal, every STOP would wait, too."""
    clock, shown = VirtualClock(), list[str]()
    here = PublicAddress.parse("http://10.0.0.2:8000")
    gateway = NetworkGateway(NetworkConfig(public=(here,), data=tmp_path), clock)
    gateway.open("Ada", shown.append)
    pairing = gateway.pairing
    assert isinstance(pairing.redeem(pairing.tokens[Role.PILOT], 0.0), Paired)
    assert not capsys.readouterr().out
    clock.sleep(1.0)  # a separate thread writes now
    assert pairing.tokens[Role.PILOT] in capsys.readouterr().out
    assert shown[-1].endswith(pairing.tokens[Role.PILOT])
