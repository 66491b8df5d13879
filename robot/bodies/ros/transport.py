"""Connects to a ROS 2 robot's topics by rosbridge or DDS, as the options choose."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from robot.bodies.ros.bridge import RosBridge
from robot.bodies.ros.topics import OnMessage, Topics
from robot.clock import Clock
from robot.devices.options import Options, option
from robot.errors import ConfigurationError, need

ROSBRIDGE, DDS = "rosbridge", "dds"
MOST_DOMAINS = 232
"""Largest number of a domain. A domain's ports begin at 7400 plus 250 times its number, so the
ports of a larger number would be invalid."""
_FEATURE = (
    "--transport dds (cyclonedds is available for Windows, macOS and Linux on x86_64, up to Python "
    "3.13; elsewhere use --transport rosbridge)"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class TransportOptions(Options):
    """The transport of the robot's topics."""

    address: str = option(
        "", "HOST or HOST:PORT of rosbridge; with --transport dds, the robot's HOST"
    )
    transport: str = option(
        ROSBRIDGE,
        "rosbridge: a program on the robot; dds: ROS 2's own protocol, without a program",
        choices=(ROSBRIDGE, DDS),
    )
    domain: int = option(0, "dds: the robot's ROS_DOMAIN_ID", range=(0, MOST_DOMAINS))
    interface: str = option(
        "", "dds: network interface, by name or address; if empty, the first one"
    )
    peers: str = option("", "dds: further HOSTs of the robot, separated by commas")

    @property
    def hosts(self) -> tuple[str, ...]:
        """Return the hosts at which DDS looks for the robot: `address` and `peers`."""
        named = (self.address, *self.peers.split(","))
        return tuple(dict.fromkeys(host.strip() for host in named if host.strip()))

    def check_transport(self) -> None:
        """Refuse options that the transport does not support."""
        if self.transport == DDS:
            for host in self.hosts:
                if ":" in host:
                    raise ConfigurationError(
                        f"--transport dds needs a HOST without a port, not {host!r}: DDS derives "
                        "its ports from --domain"
                    )
            return
        for flag, value in (("--interface", self.interface), ("--peers", self.peers)):
            if value:
                raise ConfigurationError(
                    f"{flag} works only with --transport dds; add this option, or omit {flag}"
                )


def open_topics(
    options: TransportOptions,
    clock: Clock,
    *,
    advertised: Mapping[str, str],
    subscribed: Mapping[str, str],
    on_message: OnMessage,
) -> Topics:
    """Connect to the robot's topics by the chosen transport, and stay connected.

    Args:
        advertised: The type of each topic that will be published.
        subscribed: The type of each topic to listen to.
        on_message: Called with each message; see `OnMessage`.

    Raises:
        DriveError: If nothing answers at the other end.
        MissingExtraError: If a library is not installed.
    """
    if options.transport == ROSBRIDGE:
        return RosBridge(
            options.address,
            clock,
            advertised=advertised,
            subscribed=subscribed,
            on_message=on_message,
        )
    need_dds()
    from robot.bodies.ros.dds import DdsTopics

    return DdsTopics(
        options.domain,
        options.hosts,
        options.interface,
        clock,
        advertised=advertised,
        subscribed=subscribed,
        on_message=on_message,
    )


def need_dds() -> None:
    """Raise MissingExtraError if Cyclone DDS is not installed."""
    need("cyclonedds", _FEATURE, "dds")
