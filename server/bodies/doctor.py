"""`drivelesson brick doctor`: examine a brick through its agent, and print what to do."""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from robot.bodies.ev3.doctor import Level, examine, write_report
from robot.bodies.ev3.examination import measure
from robot.bodies.ev3.link import BrickLink
from robot.errors import ConfigurationError

if TYPE_CHECKING:
    from robot.bodies.ev3.fake_brick import FakeBrick

CONSENT = (
    "The wheels will turn for ten seconds. Lift the robot; then Enter to turn them, n to not: "
)


def examine_brick(args: argparse.Namespace) -> int:
    """Examine a brick and print the report; return 1 if something is wrong."""
    if args.fake:
        with fake_brick() as (address, secret):
            return examine_at(address, secret, lambda: True)
    if not args.address:
        raise ConfigurationError("which brick? drivelesson brick doctor ADDRESS, or --fake")
    host = args.address.rpartition("@")[2]
    address = host if ":" in host else f"{host}:{args.port}"
    return examine_at(address, "", lambda: True if args.yes else ask_consent())


def examine_at(address: str, secret: str, may_turn_wheels: Callable[[], bool]) -> int:
    """Examine the brick that listens there, and print the report; 1 if something is wrong."""
    print(f"examining the brick at {address.partition(':')[0]}, about half a minute ...\n")
    findings = examine(measure(BrickLink(address, secret), may_turn_wheels))
    print(write_report(findings))
    return int(any(finding.level is Level.WRONG for finding in findings))


def ask_consent() -> bool:
    """Ask whether the wheels may turn; the end of input means no."""
    try:
        return input(CONSENT).strip().lower() in ("", "y", "yes")
    except EOFError:
        return False


@contextmanager
def fake_brick() -> Iterator[tuple[str, str]]:
    """Run a brick made of files and the real agent on it; yields address and secret."""
    from robot.bodies.ev3.fake_agent import SECRET, FakeAgent
    from robot.bodies.ev3.fake_brick import FakeBrick

    with tempfile.TemporaryDirectory() as folder, FakeBrick(Path(folder, "brick")) as brick:
        furnish(brick)
        with FakeAgent(brick) as agent:
            yield agent.address, SECRET


def furnish(brick: FakeBrick) -> None:
    """Plug in what the robot of the guide has."""
    brick.add_sensor("in4", "lego-ev3-us", 1234, decimals=1)
    for port in ("in1", "in2"):
        brick.add_sensor(port, "lego-ev3-touch", 0)
