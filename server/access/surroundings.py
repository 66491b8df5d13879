"""Tracks a running server's environment: addresses, names, the wall clock.

All three can change while the server runs: Wi-Fi connects late, a router assigns another address,
the clock of a small computer leaps from 1970 to today. `Watch` checks them every second.
"""

from __future__ import annotations

import dataclasses
import logging
import socket
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from robot.clock import Clock, Worker
from server.access.config import NetworkConfig
from server.access.network import host_names, lan_addresses, names_in_network, page_addresses

log = logging.getLogger(__name__)
LOOK_EVERY_S = 1.0
"""Time between two checks of the network, in seconds."""
CLAIM_EVERY_S = 10.0
"""Interval at which a robot asks whether another robot has its name, in seconds. Asking once is not
enough: robots that start at the same moment miss each other's first query."""
ASK_EVERY_S = 60.0
"""Interval at which the resolver is asked for this machine's names even if nothing has changed, in
seconds."""


@dataclass(frozen=True, slots=True)
class Place:
    """The names and addresses of the robot on the network.

    Attributes:
        hostname: The announced name, without `.local`.
        addresses: The addresses of this machine, the best first.
        names: This machine's names from the resolver.
        machine: The computer's own name, which a person or the network may change.
    """

    hostname: str
    addresses: tuple[str, ...]
    names: tuple[str, ...] = ()
    machine: str = ""


class Surroundings:
    """The current names and addresses of one server; the guard tests names with `in`.

    Args:
        config: The server's configuration; `hostname` is the name that the robot wants.
        addresses: Returns this machine's addresses, the best first.
        ask_names: Asks the resolver for this machine's names; may take long.
        claim: Announces the robot at the given addresses and returns the name that it got; None if
            the robot is not announced.
        is_taken: Returns True if another robot has the same name, and this one needs a new name.
    """

    def __init__(
        self,
        config: NetworkConfig,
        *,
        addresses: Callable[[NetworkConfig], Sequence[str]] = lan_addresses,
        ask_names: Callable[[str, Sequence[str]], Sequence[str]] = names_in_network,
        claim: Callable[[Sequence[str]], str] | None = None,
        is_taken: Callable[[Sequence[str]], bool] = lambda _: False,
    ) -> None:
        self._config, self._look, self._ask, self._claim = config, addresses, ask_names, claim
        self._is_taken = is_taken
        found = tuple(addresses(config)) if config.lan else ()
        self.now = Place(config.hostname, found, machine=socket.gethostname())
        self._known = self._names_known()
        self.listeners: list[Callable[[Place, Place], None]] = []
        """Functions that are called at each change of `now`, with its old and its new value."""
        self.ticks: list[Callable[[Place], None]] = []
        """Functions that are called at every check, for example to renew a certificate."""
        self._is_claimed = claim is None
        self._asked_s: float | None = None
        self._claimed_s = 0.0

    def __contains__(self, name: object) -> bool:
        """True if this is a name of the robot.

        On the local network, every name without a dot is accepted, because no page on the internet
        can have such a name.
        """
        place = self.now
        if name in self._known or name in place.names:
            return True
        text = str(name)
        return self._config.lan and bool(text) and "." not in text and ":" not in text

    def _names_known(self) -> frozenset[str]:
        public = (address.name for address in self._config.public)
        return frozenset([*host_names(self.config_now), *public])

    @property
    def config_now(self) -> NetworkConfig:
        """The configuration with the name that the robot has now, for example NAME-2."""
        return dataclasses.replace(self._config, hostname=self.now.hostname)

    @property
    def page_addresses(self) -> list[str]:
        return page_addresses(self.config_now, self.now.addresses)

    @property
    def certified(self) -> list[str]:
        """The names and addresses that a certificate must contain."""
        place = self.now
        return list(dict.fromkeys([*host_names(self.config_now), *place.names, *place.addresses]))

    def look(self, now_s: float = 0.0) -> bool:
        """Check once; return True if something has changed."""
        before = self.now
        addresses, machine = tuple(self._look(self._config)), socket.gethostname()
        is_new = addresses != before.addresses
        if is_new or machine != before.machine:
            self._asked_s = None
        # Accept the new addresses first: claiming a name takes a second.
        self._change(dataclasses.replace(before, addresses=addresses, machine=machine))
        is_due = bool(addresses) and now_s - self._claimed_s >= CLAIM_EVERY_S
        if is_new or not self._is_claimed or (is_due and self._is_taken(addresses)):
            self._is_claimed = True
            if self._claim is not None:
                hostname = self._claim(addresses)
                self._change(dataclasses.replace(self.now, hostname=hostname))
            self._claimed_s = now_s
        elif is_due:
            self._claimed_s = now_s
        for tick in self.ticks:
            tick(self.now)
        return self.now != before

    def ask(self, now_s: float) -> None:
        """If the resolver's last answer is old, ask it again for this machine's names, and wait."""
        if self._asked_s is not None and now_s - self._asked_s < ASK_EVERY_S:
            return
        self._asked_s = now_s
        place = self.now
        names = tuple(self._ask(place.hostname, place.addresses))
        if self.now.addresses == place.addresses:
            self._change(dataclasses.replace(self.now, names=names))

    def _change(self, place: Place) -> None:
        before, self.now = self.now, place
        if place == before:
            return
        self._known = self._names_known()
        log.info(
            "network addresses=%s name=%s.local names=%s",
            ",".join(place.addresses) or "none", place.hostname, ",".join(place.names) or "none",
        )  # fmt: skip
        for listener in self.listeners:
            listener(before, place)


class Watch:
    """Checks the surroundings regularly on a thread; asks the slow resolver on a second thread."""

    def __init__(self, surroundings: Surroundings, clock: Clock) -> None:
        self._surroundings, self._clock = surroundings, clock
        self._ending = threading.Event()
        self._threads: list[Worker] = []
        self._looked = threading.Event()

    def start(self) -> None:
        self._threads = [
            self._clock.start_thread(self._run, "surroundings"),
            self._clock.start_thread(self._ask, "names"),
        ]

    def wait_for_the_first(self, timeout_s: float) -> None:
        """Wait at most `timeout_s` for the end of the first check, which announces the robot."""
        self._clock.wait(self._looked, timeout_s)

    def stop(self) -> None:
        self._ending.set()
        if self._threads:
            self._threads[0].join(timeout=LOOK_EVERY_S)

    def _run(self) -> None:
        while not self._ending.is_set():
            try:
                self._surroundings.look(self._clock.now_s())
            except Exception:  # the thread that watches the network must survive its errors
                log.exception("cannot look up this machine's addresses")
            self._looked.set()
            self._clock.wait(self._ending, LOOK_EVERY_S)

    def _ask(self) -> None:
        self._clock.wait(self._looked, None)
        while not self._ending.is_set():
            try:
                self._surroundings.ask(self._clock.now_s())
            except Exception:
                log.exception("cannot look up this machine's names")
            self._clock.wait(self._ending, LOOK_EVERY_S)
