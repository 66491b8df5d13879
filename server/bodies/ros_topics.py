"""List the topics of a ROS 2 robot, found over DDS, and suggest options for them."""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Iterable

from robot.bodies.ros.suggestion import Endpoint, suggest
from robot.bodies.ros.transport import DDS, TransportOptions, need_dds
from robot.clock import RealClock
from robot.devices.options import make_options, options_of
from robot.errors import DriveError, quoted
from server.cli.parser import declare, number

_OURS = ("address", "domain", "interface", "peers")


def configure(parser: argparse.ArgumentParser) -> None:
    for option in options_of(TransportOptions):
        if option.name in _OURS:
            declare(parser, option)
    parser.add_argument(
        "--seconds",
        type=number(above=0),
        default=4.0,
        help="duration of the search, in seconds (default: %(default)s)",
    )


def run(args: argparse.Namespace) -> int:
    """Find the topics, and print a table and a command."""
    options = make_options(TransportOptions, {**vars(args), "transport": DDS})
    need_dds()
    from robot.bodies.ros.dds import neighbours_of

    found = neighbours_of(
        options.domain, options.hosts, options.interface, RealClock(), args.seconds
    )
    if not found:
        raise DriveError(
            f"no topics were seen in ROS domain {options.domain} within {args.seconds:g} s; is "
            "ROS_DOMAIN_ID the same on the robot? Give the robot's host with --address; if this "
            "computer is in several networks, choose one with --interface"
        )
    for line in _table(found):
        print(line)
    given = [
        word
        for option in options_of(TransportOptions)
        if option.name in _OURS and (value := getattr(options, option.name)) != option.default
        for word in (option.flag, quoted(str(value)))
    ]
    words = [*given, *suggest(found)]
    print("\nDrive with:")
    print(
        f"  drivelesson serve --robot ros --camera ros --transport dds {' '.join(words)}".rstrip()
    )
    return 0


def _table(found: Iterable[Endpoint]) -> list[str]:
    """Return a line for each topic and type, with the number of its publishers and subscribers."""
    counts: dict[tuple[str, str], list[int]] = defaultdict(lambda: [0, 0])
    for each in found:
        counts[each.topic, each.kind][0 if each.publishes else 1] += 1
    wide, kind_wide = (max(len(key[at]) for key in counts) for at in (0, 1))
    return [
        f"{topic:<{wide}}  {kind:<{kind_wide}}  {publishers} publish, {subscribers} subscribe"
        for (topic, kind), (publishers, subscribers) in sorted(counts.items())
    ]
