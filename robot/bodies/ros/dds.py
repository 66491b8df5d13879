"""DDS, the network protocol of ROS 2, without ROS: topics by Eclipse Cyclone DDS.

All parts of this program share one participant per domain. Named peers are discovered by unicast.
DDS itself notices only after ten seconds or more that another program is gone. This module notices
it sooner, because messages are not acknowledged, the watchdog on the robot is silent, or no new
picture arrives.
"""

from __future__ import annotations

import contextlib
import ipaddress
import logging
import os
import socket
import threading
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar
from xml.sax.saxutils import quoteattr

from cyclonedds.builtin import (
    BuiltinDataReader,
    BuiltinTopicDcpsPublication,
    BuiltinTopicDcpsSubscription,
)
from cyclonedds.core import (
    DDSException,
    InstanceState,
    ReadCondition,
    SampleState,
    ViewState,
    WaitSet,
)
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from robot.bodies.ros.messages import TYPES, dds_topic, from_dds, ros_topic, ros_type, to_dds
from robot.bodies.ros.suggestion import Endpoint
from robot.bodies.ros.topics import COMPRESSED, RAW, VELOCITIES, End, Message, OnMessage, Topics
from robot.clock import Clock
from robot.errors import DriveError, told_as

log = logging.getLogger(__name__)
FOUND_S = 5.0
"""Time for which a new connection waits for the robot, in seconds."""
_ASK_EVERY_S = 2
"""Interval of discovery messages to peers, in seconds."""
_MOST_PROCESSES = 50
"""Number of ports per named peer to which discovery messages are sent. Each process of a peer has a
port of its own."""
_LOOK_EVERY_S, _ANSWER_EVERY_S = 0.05, 0.05
"""Maximum times for which a thread waits for messages, and another thread for acknowledgements, in
seconds."""
_HEARTBEAT = '<HeartbeatInterval min="1 ms" minsched="5 ms" max="20 ms">10 ms</HeartbeatInterval>'
"""Interval at which a writer requests acknowledgements. By default, a writer that is never idle may
wait several seconds before it requests one."""
_LAST_ANSWER_S = 0.2
"""Time for which `close` waits for the acknowledgement of the last order, in seconds."""
_SETTLED_S = 1.0
"""Time limit within which DDS matches the robot's subscriber with this program's publisher, in
seconds. After this time the topic counts as refused."""
_BLOCKED_S = 0.1
_TAKEN = 16
_MOST_WARNINGS = 100
_NEEDED = (*VELOCITIES, COMPRESSED, RAW)
"""Types of topics that the robot must have: another program must publish such a topic, or subscribe
to it."""
_NS = 1_000_000_000
_ANY = ViewState.Any | SampleState.Any | InstanceState.Any
# Orders are sent reliably, because ROS's subscribers request it; only the newest order is resent.
_ORDERS = Qos(
    Policy.Reliability.Reliable(int(_BLOCKED_S * _NS)),
    Policy.History.KeepLast(1),
    Policy.Durability.Volatile,
)
# A best-effort reader matches every publisher, and does not request lost messages again.
_NEWEST = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(1), Policy.Durability.Volatile)


def configuration(hosts: Sequence[str], interface: str) -> str:
    """Return the configuration of Cyclone DDS: CYCLONEDDS_URI, overridden by our settings.

    Raises:
        DriveError: If a host is unknown.
    """
    peers = [_address_of(host) for host in hosts]
    if not interface and peers and all(ipaddress.ip_address(peer).is_loopback for peer in peers):
        interface = "127.0.0.1"
    general = discovery = ""
    if interface:
        key = "address" if _is_address(interface) else "name"
        general = f"<Interfaces><NetworkInterface {key}={quoteattr(interface)}/></Interfaces>"
    if peers:
        general += "<AllowMulticast>false</AllowMulticast>"
        # Without PruneDelay, a peer that does not answer within 30 s is never tried again.
        named = "".join(f'<Peer Address="{peer}" PruneDelay="inf"/>' for peer in peers)
        discovery = (
            f"<Peers>{named}</Peers><SPDPInterval>{_ASK_EVERY_S} s</SPDPInterval>"
            f"<MaxAutoParticipantIndex>{_MOST_PROCESSES - 1}</MaxAutoParticipantIndex>"
        )
    ours = (
        f"<CycloneDDS><Domain><General>{general}</General><Discovery>"
        f"<ParticipantIndex>auto</ParticipantIndex>{discovery}</Discovery>"
        f"<Internal>{_HEARTBEAT}</Internal></Domain></CycloneDDS>"
    )
    theirs = os.environ.get("CYCLONEDDS_URI", "")
    return f"{theirs},{ours}" if theirs else ours


def _is_address(text: str) -> bool:
    with contextlib.suppress(ValueError):
        ipaddress.ip_address(text)
        return True
    return False


def _address_of(host: str) -> str:
    with told_as(DriveError, f"the host {host!r} is unknown", do="check --address and --peers"):
        found = socket.getaddrinfo(host, None, socket.AF_INET, socket.SOCK_DGRAM)
    return str(found[0][4][0])


class Participant:
    """This program's one participant in a domain.

    Raises:
        DriveError: If there is no such interface, or the domain is in use with other options.
    """

    _all: ClassVar[dict[int, Participant]] = {}
    _lock: ClassVar[threading.Lock] = threading.Lock()

    def __init__(self, domain: int, config: str) -> None:
        self.domain, self._config, self._users = domain, config, 0
        with told_as(
            DriveError,
            f"this computer cannot join ROS domain {domain}",
            DDSException,
            UnicodeEncodeError,
            do="check --interface and CYCLONEDDS_URI",
        ):
            self._domain = Domain(domain, config)
            self.entity = DomainParticipant(domain)

    @classmethod
    def join(cls, domain: int, config: str) -> Participant:
        """Return the participant of this domain; call `leave` afterwards."""
        with cls._lock:
            found = cls._all.get(domain)
            if found is None:
                found = cls._all[domain] = cls(domain, config)
            elif found._config != config:
                raise DriveError(
                    f"this program already uses ROS domain {domain} with another --address, "
                    "--peers or --interface; give robot and camera the same options"
                )
            found._users += 1
            return found

    def leave(self) -> None:
        """Release the participant, which ends when its last user has released it."""
        with self._lock:
            self._users -= 1
            if not self._users:
                del self._all[self.domain]
                del self.entity, self._domain


class Neighbours:
    """The publishers and subscribers of other programs in a domain."""

    def __init__(self, participant: DomainParticipant, clock: Clock) -> None:
        self._clock, self._own = clock, participant.get_guid()
        self._readers = {
            BuiltinDataReader(participant, topic): publishes
            for topic, publishes in (
                (BuiltinTopicDcpsPublication, True),
                (BuiltinTopicDcpsSubscription, False),
            )
        }
        self.conditions = [ReadCondition(reader, _ANY) for reader in self._readers]
        self._seen: dict[Any, Endpoint] = {}

    def look(self) -> None:
        """Read which publishers and subscribers have appeared or disappeared."""
        for reader, publishes in self._readers.items():
            while samples := reader.take(_TAKEN):
                for sample in samples:
                    self._take(sample, publishes)

    def _take(self, sample: Any, publishes: bool) -> None:
        info = sample.sample_info
        if not info.valid_data or info.instance_state != InstanceState.Alive:
            self._seen.pop(sample.key, None)
            return
        topic = ros_topic(sample.topic_name)
        if topic is not None and sample.participant_key != self._own:
            now_s = self._clock.now_s()
            self._seen[sample.key] = Endpoint(topic, ros_type(sample.type_name), publishes, now_s)

    @property
    def endpoints(self) -> tuple[Endpoint, ...]:
        """Return all current publishers and subscribers."""
        return tuple(self._seen.values())

    def kinds(self, topic: str, *, publishes: bool) -> dict[str, float]:
        """Return the types of a topic's publishers or subscribers, with the time at which each was
        found."""
        named = "/" + topic.removeprefix("/")
        return {
            each.kind: each.seen_s
            for each in self.endpoints
            if (each.topic, each.publishes) == (named, publishes)
        }


class DdsTopics(Topics):
    """Publishes and subscribes in a domain, on separate threads.

    Args:
        domain: The robot's ROS_DOMAIN_ID.
        hosts: The robot's hosts; if empty, the robot is discovered by multicast.
        interface: Name or address of the network interface; if empty, the first interface.

    Raises:
        DriveError: If a host or an interface is unknown.
    """

    def __init__(
        self,
        domain: int,
        hosts: Sequence[str],
        interface: str,
        clock: Clock,
        *,
        advertised: Mapping[str, str],
        subscribed: Mapping[str, str],
        on_message: OnMessage,
    ) -> None:
        self.where = f"ROS domain {domain}"
        self._clock, self._on_message = clock, on_message
        self._advertised, self._subscribed = advertised, subscribed
        self._lock, self._ending = threading.Lock(), threading.Event()
        self._ends: dict[str, tuple[float, Message]] = {}
        self._written, self._wrote_s = threading.Event(), 0.0
        self._unanswered_s: float | None = None
        self._warned: set[str] = set()
        self._shared: Participant | None = Participant.join(domain, configuration(hosts, interface))
        participant = self._shared.entity
        self._neighbours = Neighbours(participant, clock)
        self._writers = {
            topic: DataWriter(participant, _topic(participant, topic, kind), _ORDERS)
            for topic, kind in advertised.items()
        }
        self._readers = {
            topic: DataReader(participant, _topic(participant, topic, kind), _NEWEST)
            for topic, kind in subscribed.items()
        }
        self._waiting = WaitSet(participant)
        conditions = [ReadCondition(each, _ANY) for each in self._readers.values()]
        for condition in (*conditions, *self._neighbours.conditions):
            self._waiting.attach(condition)
        self._threads = [
            threading.Thread(target=work, name="dds", daemon=True)
            for work in (self._run, self._await_acknowledgements)
        ]
        for thread in self._threads:
            thread.start()
        self._wait_for_listeners()

    def _wait_for_listeners(self) -> None:
        """Wait until another program subscribes to the velocities. If none does, `refusal` contains
        the reason."""
        deadline_s = self._clock.now_s() + FOUND_S
        while self._is_unheard() and self._clock.now_s() < deadline_s:
            kinds = [self._neighbours.kinds(topic, publishes=False) for topic in self._advertised]
            if any(self._is_settled(each) for each in kinds):
                return
            self._clock.sleep(_LOOK_EVERY_S)

    def _is_unheard(self) -> bool:
        return any(
            not self._writers[topic].get_matched_subscriptions()
            for topic, kind in self._advertised.items()
            if kind in VELOCITIES
        )

    def _is_settled(self, kinds: Mapping[str, float]) -> bool:
        return any(self._clock.now_s() - seen_s > _SETTLED_S for seen_s in kinds.values())

    @property
    def silent_s(self) -> float:
        since_s = self._unanswered_s
        return 0.0 if since_s is None else self._clock.now_s() - since_s

    @property
    def refusal(self) -> str:
        if self._shared is None:
            return ""
        for topic, kind in (*self._advertised.items(), *self._subscribed.items()):
            publishes = topic in self._subscribed
            if not publishes and self._writers[topic].get_matched_subscriptions():
                continue
            kinds = self._neighbours.kinds(topic, publishes=publishes)
            if others := ", ".join(sorted(set(kinds) - {kind})):
                if kind not in kinds:
                    return f"{topic} has the type {others} on the robot, not {kind}"
            elif not kinds and kind in _NEEDED:
                does = "publishes" if publishes else "subscribes to"
                return f"nothing {does} {topic}, {self._what_is_there()}"
            if not publishes and kind in kinds and self._is_settled(kinds):
                return (
                    f"the subscriber of {topic} requests a quality of service (QoS) that this "
                    "program does not offer"
                )
        return ""

    def _what_is_there(self) -> str:
        """Return advice for a person, because no topic has the wanted name."""
        named = sorted({each.topic for each in self._neighbours.endpoints})
        do = "`drivelesson ros-topics` lists what is there"
        if not named:
            return f"and no robot was found; are --domain and --address right? {do}"
        return f"but there are {len(named)} other topics; {do}"

    def publish(self, topic: str, message: Message, ends: End | None = None) -> None:
        with self._lock:
            self._write(topic, message, ends)

    def publish_soon(self, topic: str, message: Message) -> None:
        with contextlib.suppress(ConnectionError):
            self.publish(topic, message)

    def _write(self, topic: str, message: Message, ends: End | None) -> None:
        """Write one message; the caller must hold the lock."""
        self._ends.pop(topic, None)
        if self._shared is None:
            raise ConnectionError("not connected")
        now_s = self._clock.now_s()
        if ends is not None:
            self._ends[topic] = now_s + ends[1], ends[0]
        with told_as(ConnectionError, f"{topic} cannot be written", DDSException):
            self._writers[topic].write(to_dds(TYPES[self._advertised[topic]], message))
        if self._advertised[topic] in VELOCITIES:
            self._wrote_s = now_s
            if self._unanswered_s is None:
                self._unanswered_s = now_s
            self._written.set()

    def _is_answered(self, within_s: float) -> bool:
        return all(
            _acknowledged(self._writers[topic], within_s)
            for topic, kind in self._advertised.items()
            if kind in VELOCITIES
        )

    def close(self) -> None:
        with self._lock:
            shared, self._shared = self._shared, None
        if shared is None:
            return
        self._is_answered(_LAST_ANSWER_S)  # wait, so that DDS can resend the last stop
        self._ending.set()
        self._written.set()
        for thread in self._threads:
            thread.join()
        del self._waiting, self._neighbours
        self._readers, self._writers = {}, {}
        shared.leave()

    # On the threads ----------------------------------------------------------------------------

    def _await_acknowledgements(self) -> None:
        """Repeatedly wait until all messages written so far are acknowledged."""
        while not self._ending.is_set():
            self._written.wait()
            began_s = self._clock.now_s()
            if self._is_answered(_ANSWER_EVERY_S):
                with self._lock:
                    has_more = self._wrote_s > began_s
                    self._unanswered_s = began_s if has_more else None
                    if not has_more:
                        self._written.clear()

    def _run(self) -> None:
        while not self._ending.is_set():
            self._waiting.wait(int(self._pause_s() * _NS))
            self._neighbours.look()
            self._warn_of_others()
            for topic, reader in self._readers.items():
                self._take(topic, reader)
            self._end_what_is_due()

    def _pause_s(self) -> float:
        with self._lock:
            due_s = min((at_s for at_s, _ in self._ends.values()), default=float("inf"))
        return max(0.001, min(_LOOK_EVERY_S, due_s - self._clock.now_s()))

    def _take(self, topic: str, reader: DataReader[Any]) -> None:
        """Pass on received messages. A sample without valid data means that a publisher is gone."""
        try:
            for sample in reader.take(_TAKEN):
                if sample.sample_info.valid_data:
                    self._note_sign()
                    self._on_message(topic, from_dds(sample))
        except Exception as error:  # other programs may send any bytes as this type
            self._warn_once(f"a message of {topic} cannot be read: {error!r}")

    def _note_sign(self) -> None:
        """Count each received message as a sign of life, too. Acknowledgements are not enough: if a
        subscriber dies, no acknowledgement arrives until DDS drops this subscriber, even if another
        subscriber has taken its place."""
        with self._lock:
            if self._unanswered_s is not None:
                self._unanswered_s = self._clock.now_s()

    def _end_what_is_due(self) -> None:
        now_s = self._clock.now_s()
        with self._lock:
            for topic, (at_s, message) in list(self._ends.items()):
                if now_s >= at_s:
                    with contextlib.suppress(ConnectionError):
                        self._write(topic, message, None)

    def _warn_of_others(self) -> None:
        for topic, kind in self._advertised.items():
            if kind in VELOCITIES and self._neighbours.kinds(topic, publishes=True):
                self._warn_once(f"another node publishes {topic}, too; the newest velocity counts")

    def _warn_once(self, text: str) -> None:
        if text not in self._warned and len(self._warned) < _MOST_WARNINGS:
            self._warned.add(text)
            log.warning("%s: %s", self.where, text)


def _topic(participant: DomainParticipant, name: str, kind: str) -> Topic[Any]:
    return Topic(participant, dds_topic(name), TYPES[kind])


def _acknowledged(writer: DataWriter[Any], within_s: float) -> bool:
    """Return True if all written messages are acknowledged within the time limit."""
    try:
        return bool(writer.wait_for_acks(int(within_s * _NS)))
    except AttributeError:  # cyclonedds 11.0.1 raises this error instead of returning False
        return False


def neighbours_of(
    domain: int, hosts: Sequence[str], interface: str, clock: Clock, seconds: float
) -> tuple[Endpoint, ...]:
    """Search a domain for some seconds, and return the publishers and subscribers of other
    programs.

    Raises:
        DriveError: If a host or an interface is unknown.
    """
    shared = Participant.join(domain, configuration(hosts, interface))
    try:
        return _search(shared.entity, clock, seconds)
    finally:
        shared.leave()


def _search(participant: DomainParticipant, clock: Clock, seconds: float) -> tuple[Endpoint, ...]:
    """Search for some seconds. DDS requires that readers end before their participant, so the
    readers of `neighbours` end when this function returns."""
    neighbours = Neighbours(participant, clock)
    clock.sleep(seconds)
    neighbours.look()
    return neighbours.endpoints
