"""A ROS 2 robot's DDS with Fast DDS in another process, and with processes that are killed.

`make conformance ARGS="--only fastdds"` builds fastdds.cpp and reports all results. Run as a
program, this is one of the processes.
"""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from rosbags.typesys import Stores, get_typestore

from robot.bodies.ros.camera import RosCamera, RosCameraOptions
from robot.bodies.ros.driver import RosDriver, RosOptions
from robot.bodies.ros.topics import COMPRESSED, STAMPED, TWIST
from robot.clock import RealClock
from robot.errors import DriveError
from robot.moves import point_of
from robot.types import Action
from tests.kit.wait import wait_until
from tests.standins.dds_robot import BASE, HERE, IMAGES, own_domain

ROS = get_typestore(Stores.ROS2_JAZZY)
DDS_TYPE = {
    TWIST: "geometry_msgs::msg::dds_::Twist_",
    STAMPED: "geometry_msgs::msg::dds_::TwistStamped_",
}
PICTURE_TYPE = "sensor_msgs::msg::dds_::CompressedImage_"
_SELF = "tests.conformance.on_dds"
N_ORDERS, N_PICTURES = 1000, 300
_WATCHED_S = 0.45
"""How long a base is watched after it first stood, in seconds; then the driver here tries again."""


def options(**more: Any) -> dict[str, Any]:
    return {"transport": "dds", "address": HERE[0], "domain": own_domain(), **more}


@contextmanager
def process(*words: object) -> Iterator[subprocess.Popen[str]]:
    pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    pipes |= {"stderr": subprocess.DEVNULL, "text": True, "bufsize": 1}
    running = subprocess.Popen(list(map(str, words)), **pipes)
    try:
        yield running
    finally:
        running.kill()
        running.communicate()


def lines_of(running: subprocess.Popen[str]) -> list[str]:
    """Return the lines of a process's output, which grow."""
    lines: list[str] = []
    threading.Thread(
        target=lambda: lines.extend(iter(running.stdout.readline, "")),  # type: ignore[union-attr]
        daemon=True,
    ).start()
    return lines


def orders(program: Path, *, stamped: bool) -> str:
    """Have Fast DDS read the driver's messages; each order must arrive exactly, and in order."""
    kind, chance = (STAMPED if stamped else TWIST), random.Random(1)
    with process(program, own_domain(), "read", f"rt{BASE}", DDS_TYPE[kind]) as reader:
        lines, wanted = lines_of(reader), []
        with RosDriver(RosOptions(**options(stamped=stamped))) as driver:
            for _ in range(N_ORDERS):
                move, speed = chance.choice(driver.moves), chance.uniform(0.1, 1.0)
                driver.send_action(move, speed_scale=speed)
                point = point_of(move, driver.declared_moves)
                assert point is not None
                wanted.append(driver.velocity(speed * point.steering, speed * point.throttle))
                time.sleep(0.02)
            time.sleep(0.2)
        told = [ROS.deserialize_cdr(bytes.fromhex(line), kind) for line in list(lines)]
    twists = [getattr(message, "twist", message) for message in told]
    speeds = [(twist.linear.x, twist.angular.z) for twist in twists]
    plain = [message.get("twist", message) for message in wanted]
    exact = [(twist["linear"]["x"], twist["angular"]["z"]) for twist in plain]
    driven = [pair for pair in speeds if any(pair)]
    n_equal = sum(a == b for a, b in zip(driven, exact, strict=False))
    assert n_equal == len(driven) == N_ORDERS, f"{n_equal} of {N_ORDERS}, {len(driven)} came"
    return f"{n_equal} of {N_ORDERS} orders exact"


def pictures(program: Path) -> str:
    """Have Fast DDS send numbered pictures; each that is shown must be one of them, in order."""
    kinds, sent, shown = ROS.types, [], list[bytes]()
    header = kinds["std_msgs/msg/Header"](kinds["builtin_interfaces/msg/Time"](1, 2), "camera")
    noise = np.random.default_rng(1).integers(0, 256, (240, 320, 3), np.uint8)
    jpeg = cv2.imencode(".jpg", noise)[1].tobytes()
    camera = RosCamera(RosCameraOptions(**options()), RealClock())
    with process(program, own_domain(), "write", f"rt{IMAGES}", PICTURE_TYPE) as writer, camera:
        assert writer.stdin is not None
        camera.listen(lambda: shown.append(camera.latest().data))  # type: ignore[union-attr]
        while len(shown) < N_PICTURES:
            assert len(sent) < 60 * N_PICTURES, "the body gives no pictures"
            sent.append(jpeg + len(sent).to_bytes(4, "big"))
            picture = kinds[COMPRESSED](header, "jpeg", np.frombuffer(sent[-1], np.uint8))
            writer.stdin.write(bytes(ROS.serialize_cdr(picture, COMPRESSED)).hex() + "\n")
            writer.stdin.flush()
            time.sleep(1.0 / 30)
    assert sorted(shown) == shown and set(shown) <= set(sent)
    return f"{len(shown)} of {len(sent)} pictures of {len(jpeg)} bytes, in order"


# Killed, frozen, disturbed -----------------------------------------------------------------------


class Robot:
    """`tests.standins.dds_robot` in a process; `velocities` are time, speed ahead and turn."""

    def __init__(self, running: subprocess.Popen[str]) -> None:
        assert running.stdout is not None and running.stdout.readline() == "ready\n"
        self.process, self._lines = running, lines_of(running)

    @property
    def velocities(self) -> list[tuple[float, float, float]]:
        return [tuple(json.loads(line)) for line in list(self._lines)]

    @property
    def is_moving(self) -> bool:
        velocities = self.velocities
        return bool(velocities) and any(velocities[-1][1:])

    def stood_after(self, since_s: float, seconds: float) -> str:
        """Wait; return how soon after `since_s` it got the order to stand, and how long it moved
        then."""
        time.sleep(seconds)
        told = [(at_s, any(speeds)) for at_s, *speeds in self.velocities if at_s >= since_s]
        stood = [at_s for at_s, moves in told if not moves]
        if not stood:
            return "drives on"
        ends = [at_s for at_s, _ in told[1:]] + [since_s + seconds]
        later_s = sum(
            max(0.0, min(end_s, stood[0] + _WATCHED_S) - at_s)
            for (at_s, moves), end_s in zip(told, ends, strict=True)
            if moves and at_s > stood[0]
        )
        return f"stands after {stood[0] - since_s:.2f} s, moves {1000 * later_s:.0f} ms then"


@contextmanager
def robot(*words: str) -> Iterator[Robot]:
    with process(sys.executable, "-m", "tests.standins.dds_robot", own_domain(), *words) as running:
        yield Robot(running)


def drive(given: dict[str, Any]) -> None:
    """Drive ahead forever, like the loop; print each fault."""
    with RosDriver(RosOptions(**given)) as driver:
        print("ready", flush=True)
        while True:
            try:
                driver.send_action(Action.FORWARD)
                driver.sense()
            except DriveError as error:
                print(error, flush=True)
            time.sleep(0.05)


def stands_after(fault: str, *, watchdog: bool) -> str:
    """Drive, cause `fault`, and return the base's reaction."""
    given = json.dumps(options(watchdog=watchdog))
    with (
        robot(*(["watchdog"] if watchdog else [])) as body,
        process(sys.executable, "-m", _SELF, "drive", given) as server,
    ):
        assert server.stdout is not None and server.stdout.readline() == "ready\n"
        lines_of(server)  # or it would wait for its reader
        wait_until(lambda: body.is_moving)
        time.sleep(0.3)
        at_s = time.monotonic()
        if fault.startswith("server"):
            server.send_signal(signal.SIGKILL if "killed" in fault else signal.SIGSTOP)
            return body.stood_after(at_s, 2.0)
        words = (sys.executable, "-m", _SELF, "disturb", own_domain(), fault)
        with process(*words) as other:
            assert other.stdout is not None and other.stdout.readline() == "ready\n"
            return body.stood_after(time.monotonic(), 2.0)


def disturb(domain: int, how: str) -> None:
    """Publish velocities beside the server, ten a second, or only one."""
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.pub import DataWriter
    from cyclonedds.topic import Topic

    from robot.bodies.ros.dds import Participant, configuration
    from robot.bodies.ros.messages import Twist, Vector3
    from tests.standins.dds_robot import AS_ROS

    if how == "a second server":
        drive({**options(watchdog=True), "domain": domain, "linear_mps": 0.3})
    Participant.join(domain, configuration(HERE, ""))
    other = DomainParticipant(domain)
    writer = DataWriter(other, Topic(other, f"rt{BASE}", Twist), AS_ROS)
    wait_until(lambda: writer.get_matched_subscriptions())
    print("ready", flush=True)
    for _ in range(1 if how == "one velocity of another node" else 100):
        writer.write(Twist(Vector3(x=0.77)))
        time.sleep(0.1)
    time.sleep(10.0)


FAULTS = (
    "server killed",
    "server frozen",
    "one velocity of another node",
    "another node, ten a second",
    "a second server",
)


def attempts(program: Path) -> Iterator[Callable[[], str]]:
    """Yield the tests; each returns its observations, or fails."""
    yield lambda: f"{orders(program, stamped=False)} (Twist)"
    yield lambda: f"{orders(program, stamped=True)} (TwistStamped)"
    yield lambda: pictures(program)
    for fault in FAULTS:
        for watchdog in (True, False):
            if watchdog or fault != "a second server":

                def disturbed(fault: str = fault, watchdog: bool = watchdog) -> str:
                    told = stands_after(fault, watchdog=watchdog)
                    assert not watchdog or told != "drives on"
                    return f"{fault}, {'with' if watchdog else 'without'} the watchdog: {told}"

                yield disturbed


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["drive", given]:
            drive(json.loads(given))
        case ["disturb", domain, how]:
            disturb(int(domain), how)
