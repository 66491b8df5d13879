"""Tests the DDS of a ROS 2 robot against Fast DDS in another process, which `__main__.py`
builds."""

from __future__ import annotations

import random
import subprocess
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
from robot.moves import point_of
from tests.standins.dds_robot import BASE, HERE, IMAGES, own_domain

ROS = get_typestore(Stores.ROS2_JAZZY)
DDS_TYPE = {
    TWIST: "geometry_msgs::msg::dds_::Twist_",
    STAMPED: "geometry_msgs::msg::dds_::TwistStamped_",
}
PICTURE_TYPE = "sensor_msgs::msg::dds_::CompressedImage_"
N_ORDERS, N_PICTURES = 1000, 300


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
    """Return the lines of a process's output; the list grows."""
    lines: list[str] = []
    threading.Thread(
        target=lambda: lines.extend(iter(running.stdout.readline, "")),
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
    assert n_equal == len(driven) == N_ORDERS, f"{n_equal} orders are equal, {len(driven)} came"
    return f"{n_equal} of {N_ORDERS} orders exact"


def pictures(program: Path) -> str:
    """Have Fast DDS send numbered pictures; the camera must show some of them, in order."""
    kinds, sent, shown = ROS.types, [], list[bytes]()
    header = kinds["std_msgs/msg/Header"](kinds["builtin_interfaces/msg/Time"](1, 2), "camera")
    noise = np.random.default_rng(1).integers(0, 256, (240, 320, 3), np.uint8)
    jpeg = cv2.imencode(".jpg", noise)[1].tobytes()
    camera = RosCamera(RosCameraOptions(**options()), RealClock())
    with process(program, own_domain(), "write", f"rt{IMAGES}", PICTURE_TYPE) as writer, camera:
        assert writer.stdin is not None
        camera.listen(lambda: shown.append(camera.latest().data))
        while len(shown) < N_PICTURES:
            assert len(sent) < 60 * N_PICTURES, "the body sends no pictures"
            sent.append(jpeg + len(sent).to_bytes(4, "big"))
            picture = kinds[COMPRESSED](header, "jpeg", np.frombuffer(sent[-1], np.uint8))
            writer.stdin.write(bytes(ROS.serialize_cdr(picture, COMPRESSED)).hex() + "\n")
            writer.stdin.flush()
            time.sleep(1.0 / 30)
    assert sorted(shown) == shown and set(shown) <= set(sent)
    return f"{len(shown)} of {len(sent)} pictures of {len(jpeg)} bytes, in order"


def attempts(program: Path) -> Iterator[Callable[[], str]]:
    """Yield the tests; each returns its observations, or fails."""
    yield lambda: f"{orders(program, stamped=False)} (Twist)"
    yield lambda: f"{orders(program, stamped=True)} (TwistStamped)"
    yield lambda: pictures(program)
