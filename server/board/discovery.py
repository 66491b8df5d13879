"""Finds robots, from a list or from their announcements on the network.

Announcements can be forged, so the board takes only the port from an announcement and connects to
the sender of the packet. Therefore nobody can direct the board to a third computer.
"""

from __future__ import annotations

import logging
import socket
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from robot.clock import RealClock
from robot.errors import ConfigurationError, need, told_as
from server.access.network import ADDRESS, ROBOT, own_addresses
from server.board.transport import RobotAddress

log = logging.getLogger(__name__)
_KINDS = {"_http._tcp.local.": False, "_https._tcp.local.": True}
_GROUP, _PORT = "224.0.0.251", 5353
_LONGEST = 9000
_LOOK_EVERY_S = 2.0
"""Interval at which this computer's addresses are looked up, in seconds."""
_ASK_EVERY_S = 60.0
"""Longest time between two queries, in seconds. The time starts at 1 s and then doubles."""


def read_list(text: str) -> list[RobotAddress]:
    """Read `HOST:PORT,...`, or a file with one address per line; `#` begins a comment."""
    file = Path(text)
    is_path = file.suffix == ".txt" or ("://" not in text and file.name != text)
    if "," not in text and (file.is_file() or is_path):
        with told_as(ConfigurationError, f"cannot read {file}", OSError, ValueError):
            lines = file.read_text("utf-8-sig").splitlines()
        words = [line.partition("#")[0].strip() for line in lines]
    else:
        words = [word.strip() for word in text.split(",")]
    found = [RobotAddress.parse(word) for word in words if word]
    if not found:
        raise ConfigurationError(f"{text!r} names no robot; give HOST:PORT,HOST:PORT or a file")
    return list(dict.fromkeys(found))


@contextmanager
def browsing(
    found: Callable[[RobotAddress], None], interfaces: Callable[[], Sequence[str]] = own_addresses
) -> Iterator[None]:
    """While the `with` block runs, call `found` on another thread for each robot's announcement.

    Queries are sent from the addresses that `interfaces` returns; they may change, for example if
    the computer joins another Wi-Fi. Raises MissingExtraError if zeroconf is not installed.
    """
    _zeroconf()
    try:
        network = _open()
    except OSError as error:
        log.warning("cannot look for robots on the network: %s", error)
        yield
        return
    ending, clock = threading.Event(), RealClock()

    def work() -> None:
        addresses: Sequence[str] = []
        look_s = ask_s = clock.now_s()
        pause_s = 1.0
        while not ending.is_set():
            if clock.now_s() >= look_s:
                before, look_s = addresses, clock.now_s() + _LOOK_EVERY_S
                with suppress(OSError):
                    addresses = interfaces()
                if addresses != before:  # ask at once in the new network
                    _join(network, addresses)
                    ask_s, pause_s = clock.now_s(), 1.0
            if clock.now_s() >= ask_s:
                _ask(network, addresses)
                ask_s, pause_s = ask_s + pause_s, min(2 * pause_s, _ASK_EVERY_S)
            with suppress(OSError):  # a timeout is an OSError
                data, source = network.recvfrom(_LONGEST)
                for address in read_announcement(data, str(source[0])):
                    found(address)

    thread = threading.Thread(target=work, name="hears-robots")
    thread.start()
    try:
        yield
    finally:
        ending.set()
        thread.join()
        network.close()


def _open() -> socket.socket:
    """Open a socket for announcements."""
    network = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        # share the port of mDNS with other programs on this computer
        for name in ("SO_REUSEADDR", "SO_REUSEPORT"):
            if hasattr(socket, name):
                network.setsockopt(socket.SOL_SOCKET, getattr(socket, name), 1)
        network.bind(("", _PORT))
        network.settimeout(0.25)
    except OSError:
        network.close()
        raise
    return network


def _join(network: socket.socket, addresses: Sequence[str]) -> None:
    """Receive announcements on these addresses of this computer, too."""
    for address in addresses:
        member = socket.inet_aton(_GROUP) + socket.inet_aton(address)
        with suppress(OSError):  # the address is gone, or its adapter has already joined
            network.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, member)


def _zeroconf() -> Any:
    return need("zeroconf", "finding robots on the network", "lan")


def _ask(network: socket.socket, addresses: Sequence[str]) -> None:
    """Ask all web servers on the network to announce themselves again."""
    zeroconf = _zeroconf()
    question = zeroconf.DNSOutgoing(0)
    for kind in _KINDS:
        question.add_question(zeroconf.DNSQuestion(kind, 12, 1))
    for address in addresses:
        with suppress(OSError):  # this address's network cable may be unplugged
            own = socket.inet_aton(address)
            network.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, own)
            for packet in question.packets():
                network.sendto(packet, (_GROUP, _PORT))


def read_announcement(data: bytes, source: str) -> list[RobotAddress]:
    """Return the robots that the computer at `source` announces in a packet.

    A robot with several addresses names its best address in each packet. Only a packet from this
    best address counts, so that each robot is found once.
    """
    zeroconf = _zeroconf()
    packet = zeroconf.DNSIncoming(data, (source, _PORT))
    records = packet.answers() if packet.valid and packet.is_response() else []
    texts = {one.key: one.text for one in records if isinstance(one, zeroconf.DNSText)}
    found = []
    for record in records:
        kind = record.name.partition(".")[2].lower()
        if kind not in _KINDS or not isinstance(record, zeroconf.DNSService) or not record.ttl:
            continue
        text = texts.get(record.key, b"")
        said = zeroconf.ServiceInfo(kind, kind, properties=text).decoded_properties
        if ROBOT in said and record.port and said.get(ADDRESS) in (None, "", source):
            found.append(RobotAddress(source, record.port, _KINDS[kind]))
    return found
