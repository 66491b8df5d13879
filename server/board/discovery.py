"""Which robots there are: from a list, or from what they announce on the network."""

from __future__ import annotations

import logging
import socket
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from robot.errors import ConfigurationError, MissingExtraError
from server.board.transport import RobotAddress
from server.hosting.discovery import ADDRESS, ROBOT

log = logging.getLogger(__name__)
_KINDS = ("_http._tcp.local.", "_https._tcp.local.")
_PATIENCE_MS = 3000


def read_list(text: str) -> list[RobotAddress]:
    """Read `HOST:PORT,...`, or a file with one address a line; `#` begins a comment.

    Raises:
        ConfigurationError: If an address is none, or the file cannot be read.
    """
    file = Path(text)
    if "," not in text and file.is_file():
        try:
            lines = file.read_text("utf-8").splitlines()
        except (OSError, ValueError) as error:
            raise ConfigurationError(f"cannot read {file}: {error}") from error
        words = [line.partition("#")[0].strip() for line in lines]
    else:
        words = [word.strip() for word in text.split(",")]
    found = [RobotAddress.parse(word) for word in words if word]
    if not found:
        raise ConfigurationError(f"{text!r} names no robot; write HOST:PORT,HOST:PORT or a file")
    return list(dict.fromkeys(found))


@contextmanager
def browsing(
    found: Callable[[RobotAddress], None], interfaces: Sequence[str] | None = None
) -> Iterator[None]:
    """Call `found` for each robot on the network inside the block, on another thread.

    Anybody can announce anything: the board takes an address from here and believes no more of it.

    Args:
        found: Gets a robot's address.
        interfaces: This computer's addresses to ask from; None: all.

    Raises:
        MissingExtraError: If zeroconf is not installed.
    """
    try:
        from zeroconf import ServiceBrowser, Zeroconf
    except ImportError as error:
        raise MissingExtraError("finding robots on the network", "lan") from error

    def on_change(zeroconf: Any, service_type: str, name: str, state_change: Any) -> None:
        if state_change.name == "Removed":
            return  # it stays on the board, and is named as away
        info = zeroconf.get_service_info(service_type, name, timeout=_PATIENCE_MS)
        address = read_service(info, is_tls=service_type.startswith("_https"))
        if address is not None:
            found(address)

    try:
        network = Zeroconf() if interfaces is None else Zeroconf(interfaces=list(interfaces))
    except OSError as error:
        log.warning("robots are not looked for on the network: %s", error)
        yield
        return
    try:
        ServiceBrowser(network, list(_KINDS), handlers=[on_change])
        yield
    finally:
        network.close()


def read_service(info: Any, *, is_tls: bool) -> RobotAddress | None:
    """Return the robot's address in an announced service; None if it is no robot."""
    properties = info.properties if info is not None else {}
    if ROBOT.encode() not in properties or not info.port:
        return None
    own = (properties.get(ADDRESS.encode()) or b"").decode("ascii", "replace")
    try:
        socket.inet_aton(own)
    except OSError:
        own = next(iter(info.parsed_addresses()), "")
    return RobotAddress(own, info.port, is_tls) if own else None
