"""Draws the wiring of robots as SVG, from a list of boxes and wires (`make docs`).

A box has its terminals along one side; a wire joins two terminals by right angles. The pictures are
plain SVG with colours that are readable on light and dark backgrounds.
"""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass
from html import escape
from pathlib import Path

from robot.bodies.gpio.driver import GpioOptions
from robot.bodies.ros.camera import RosCameraOptions
from robot.bodies.ros.driver import RosOptions

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs/images"
IMAGES, ADVICE = RosCameraOptions().image_topic, "/drivelesson/advice"
PITCH_PX, HEAD_PX, FONT_PX = 26, 40, 14
RED, BLACK, BLUE, GREEN = "#d33", "#555", "#27c", "#283"


@dataclass(frozen=True)
class Box:
    """A part: its title, its position, and its terminals on either side, from top to bottom."""

    title: str
    x: int
    y: int
    width: int
    left: tuple[str, ...] = ()
    right: tuple[str, ...] = ()
    note: str = ""

    @property
    def _top(self) -> int:
        return self.y + HEAD_PX + (20 if self.note else 0)

    @property
    def height(self) -> int:
        rows = max(len(self.left), len(self.right))
        return self._top - self.y + PITCH_PX * rows + (4 if rows else -6)

    def point(self, terminal: str) -> tuple[int, int]:
        """Return the point at which a wire is attached."""
        is_left = terminal in self.left
        row = (self.left if is_left else self.right).index(terminal)
        return self.x + (0 if is_left else self.width), self._top + PITCH_PX * row + 8


@dataclass(frozen=True)
class Wire:
    """From one terminal to another; `at` is where it bends."""

    start: tuple[Box, str]
    end: tuple[Box, str]
    colour: str
    at: int


@dataclass(frozen=True)
class Drawing:
    """A separate picture."""

    name: str
    title: str
    width: int
    height: int
    boxes: tuple[Box, ...]
    wires: tuple[Wire, ...]


def draw(drawing: Drawing) -> str:
    """Return the picture as SVG."""
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {drawing.width} {drawing.height}" '
        f'width="{drawing.width}" font-family="sans-serif" font-size="{FONT_PX}" role="img" '
        f'aria-label="{escape(drawing.title)}">',
        f"<title>{escape(drawing.title)}</title>",
        f'<rect width="{drawing.width}" height="{drawing.height}" rx="10" fill="#fff"/>',
    ]
    for wire in drawing.wires:
        (x1, y1), (x2, y2) = wire.start[0].point(wire.start[1]), wire.end[0].point(wire.end[1])
        lines.append(
            f'<path d="M{x1} {y1}H{wire.at}V{y2}H{x2}" fill="none" stroke="{wire.colour}" '
            'stroke-width="3" stroke-linejoin="round"/>'
        )
    for box in drawing.boxes:
        lines += _box(box)
    return "\n".join([*lines, "</svg>"]) + "\n"


def _box(box: Box) -> list[str]:
    middle = box.x + box.width // 2
    lines = [
        f'<rect x="{box.x}" y="{box.y}" width="{box.width}" height="{box.height}" rx="8" '
        'fill="#f3f3f0" stroke="#333" stroke-width="2"/>',
        f'<text x="{middle}" y="{box.y + 24}" text-anchor="middle" font-weight="bold" '
        f'fill="#111">{escape(box.title)}</text>',
    ]
    if box.note:
        lines.append(
            f'<text x="{middle}" y="{box.y + 43}" text-anchor="middle" font-size="12" '
            f'fill="#444">{escape(box.note)}</text>'
        )
    for terminal in (*box.left, *box.right):
        x, y = box.point(terminal)
        text_x, anchor = (x + 10, "start") if terminal in box.left else (x - 10, "end")
        lines.append(f'<circle cx="{x}" cy="{y}" r="5" fill="#fff" stroke="#333"/>')
        lines.append(
            f'<text x="{text_x}" y="{y + 5}" text-anchor="{anchor}" fill="#111">'
            f"{escape(terminal)}</text>"
        )
    return lines


def _pybricks() -> Drawing:
    """The ports as the program on the hub has them."""
    ports = dict(
        re.findall(
            r"^(LEFT|RIGHT|EYES, BUMPER).*?(Port.*)$",
            (ROOT / "docs/examples/firmware/hub.py").read_text("utf-8"),
            re.MULTILINE,
        )
    )
    left, right = ("port " + ports[side].split(".")[1][0] for side in ("LEFT", "RIGHT"))
    eyes, bumper = ("port " + part[0] for part in ports["EYES, BUMPER"].split("Port.")[1:])
    phone = Box("phone", 240, 16, 200, note="the eye, looks ahead")
    hub = Box("hub with Pybricks", 240, 100, 200, (left, eyes), (right, bumper))
    wheel = Box("left motor", 16, 86, 140, (), ("cable",))
    other = Box("right motor", 524, 86, 140, ("cable",))
    sonar = Box("distance sensor", 16, 182, 140, (), ("cable ",), note="may be left out")
    force = Box("force sensor", 524, 182, 140, ("cable ",), note="may be left out")
    wires = (
        Wire((wheel, "cable"), (hub, left), BLUE, 198),
        Wire((other, "cable"), (hub, right), BLUE, 482),
        Wire((sonar, "cable "), (hub, eyes), GREEN, 198),
        Wire((force, "cable "), (hub, bumper), GREEN, 482),
    )
    boxes = (phone, hub, wheel, other, sonar, force)
    return Drawing("wiring-pybricks", "A LEGO hub as a robot", 680, 290, boxes, wires)


def _with_motor_board(
    name: str, title: str, board: str, pins: tuple[str, ...], grounds: str, note: str
) -> Drawing:
    """A board with four pins at a motor driver, which has the motors and their battery."""
    brain = Box(board, 16, 90, 190, (), (*pins, grounds), note=note)
    inputs = ("left forward", "left back", "right forward", "right back", "ground")
    driver = Box(
        "motor driver",
        290,
        90,
        260,
        inputs,
        ("left motor", "right motor", "battery +", "battery -"),
    )
    left, right = (
        Box("left motor", 650, 16, 150, ("two wires",)),
        Box("right motor", 650, 100, 150, ("two wires",)),
    )
    battery = Box("battery", 650, 184, 150, ("+", "-"), note="for the motors alone")
    colours = (BLUE, BLUE, GREEN, GREEN, BLACK)
    wires = [
        Wire((brain, pin), (driver, terminal), colour, 248)
        for pin, terminal, colour in zip((*pins, grounds), inputs, colours, strict=True)
    ]
    wires += [
        Wire((driver, "left motor"), (left, "two wires"), BLUE, 590),
        Wire((driver, "right motor"), (right, "two wires"), GREEN, 610),
        Wire((driver, "battery +"), (battery, "+"), RED, 620),
        Wire((driver, "battery -"), (battery, "-"), BLACK, 600),
    ]
    return Drawing(name, title, 816, 310, (brain, driver, left, right, battery), tuple(wires))


def _gpio() -> Drawing:
    """The pins as the driver's options have them; in brackets the positions on the header."""
    header = {17: 11, 18: 12, 22: 15, 23: 16}
    left, right = GpioOptions().settings()["motor_pins"]
    pins = tuple(f"GPIO {pin} (pin {header[pin]})" for pin in left + right)
    title = "A Raspberry Pi with a motor driver"
    return _with_motor_board("wiring-gpio", title, "Raspberry Pi", pins, "ground (pin 14)", "")


def _firmware() -> Drawing:
    """The pins as the sample firmware has them."""
    text = (ROOT / "docs/examples/firmware/robot.py").read_text("utf-8")
    found = re.search(r"^PINS = (.*?)  #", text, re.MULTILINE)
    assert found is not None
    pins = tuple(f"pin {number}" for number in ast.literal_eval(found[1]))
    title = "An ESP32 or a Raspberry Pi Pico W with a motor driver"
    return _with_motor_board("wiring-esp32", title, "ESP32, Pico W", pins, "GND", "")


def _ros() -> Drawing:
    """The topics as the driver's and the camera's options have them."""
    options = RosOptions()
    server = Box(
        "drivelesson", 16, 16, 190, (), ("velocities", "pictures", "advice"), "drives and learns"
    )
    bridge = Box(
        "rosbridge, or DDS itself",
        280,
        16,
        330,
        ("in", "out", "in "),
        (options.cmd_vel_topic, IMAGES, ADVICE),
        "with --transport dds no program is in between",
    )
    base = Box("base", 700, 16, 190, ("takes velocities",), note="must stop by itself")
    camera = Box("camera", 700, 110, 190, ("JPEG pictures",))
    other = Box("your own node", 700, 186, 190, ("what it would do",), note="may be left out")
    wires = (
        Wire((server, "velocities"), (bridge, "in"), RED, 240),
        Wire((server, "pictures"), (bridge, "out"), BLUE, 246),
        Wire((server, "advice"), (bridge, "in "), GREEN, 252),
        Wire((bridge, options.cmd_vel_topic), (base, "takes velocities"), RED, 660),
        Wire((bridge, IMAGES), (camera, "JPEG pictures"), BLUE, 650),
        Wire((bridge, ADVICE), (other, "what it would do"), GREEN, 640),
    )
    boxes = (server, bridge, base, camera, other)
    return Drawing("wiring-ros", "Drivelesson beside ROS 2", 906, 290, boxes, wires)


def _lego_education() -> Drawing:
    """There are no cables, so this shows which part lies on which."""
    phone = Box("phone", 190, 16, 230, note="the eye, looks ahead")
    motor = Box("double motor", 190, 100, 230, ("left",), ("right",), note="button: STOP")
    left = Box("wheel", 16, 106, 110, (), ("axle",))
    right = Box("wheel", 484, 106, 110, ("axle",))
    laptop = Box("laptop", 190, 216, 230, note="Bluetooth and Wi-Fi")
    wires = (
        Wire((left, "axle"), (motor, "left"), BLACK, 158),
        Wire((right, "axle"), (motor, "right"), BLACK, 452),
    )
    boxes = (phone, motor, left, right, laptop)
    return Drawing(
        "wiring-lego-education", "A LEGO double motor as a robot", 610, 290, boxes, wires
    )


DRAWINGS = (_pybricks, _gpio, _firmware, _ros, _lego_education)


def render() -> dict[Path, str]:
    """Return each picture's file and text."""
    made = [draw_now() for draw_now in DRAWINGS]
    return {FOLDER / f"{drawing.name}.svg": draw(drawing) for drawing in made}
