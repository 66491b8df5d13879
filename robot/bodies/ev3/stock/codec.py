"""The direct commands of LEGO's own EV3 firmware that a robot on wheels needs. Pure.

A message consists of its remaining length in two bytes, a number that the answer repeats, the kind,
the sizes of the variables, and bytecodes. All numbers are little-endian. Numbers in bytecodes have
one, two, three or five bytes. Source: LEGO, EV3 Communication and EV3 Firmware Developer Kits
(2013).
"""

from __future__ import annotations

import struct

from robot.errors import DriveError

MAX_MESSAGE = 1024
_HEAD = struct.Struct("<HHBH")
_ANSWER = struct.Struct("<HHB")
_REPLY, _ERROR = 0x02, 0x04
LARGE_MOTOR, MEDIUM_MOTOR, TOUCH, ULTRASONIC = 7, 8, 16, 30
"""The firmware's numbers of device types."""
OUTPUTS = 0x10
"""Number of the first motor port in commands that read sensors."""


def number(value: int) -> bytes:
    """Encode a constant in the fewest bytes; raises ValueError if it has more than 32 bits."""
    if -32 <= value < 32:
        return bytes([value & 0x3F])
    for kind, n_bits, form in ((0x81, 8, "<Bb"), (0x82, 16, "<Bh"), (0x83, 32, "<Bi")):
        if abs(value) < 1 << (n_bits - 1):
            return struct.pack(form, kind, value)
    raise ValueError(f"a constant has at most 32 bits, not {value}")


def result(index: int) -> bytes:
    """Encode where the firmware stores a result: the byte offset among the global variables."""
    return bytes([0x60 | index]) if index < 32 else bytes([0xE1, index])


def command(count: int, codes: bytes, results: int = 0) -> bytes:
    """Wrap bytecodes as a direct command whose answer has `results` bytes of variables. Raises
    ValueError if the command is longer than the firmware accepts."""
    body = _HEAD.pack(_HEAD.size - 2 + len(codes), count, 0x00, results) + codes
    if len(body) > MAX_MESSAGE:
        raise ValueError(f"a direct command has at most {MAX_MESSAGE} bytes")
    return body


def parse_answer(message: bytes, asked: int, results: int = 0) -> bytes:
    """Return the global variables in the brick's answer. `asked` is the number of the question.
    Raises DriveError if the answer belongs to another question, reports a failure, or has fewer
    than `results` bytes."""
    length, count, kind = _ANSWER.unpack(message[: _ANSWER.size].ljust(_ANSWER.size, b"\0"))
    if kind == _ERROR:
        raise DriveError("the brick refused a command")
    if kind != _REPLY or length + 2 != len(message):
        raise DriveError("the brick sent something other than a reply")
    if count != asked or length + 2 < _ANSWER.size + results:
        raise DriveError("the brick answered another command than the last one")
    return message[_ANSWER.size :]


def timed_speed(ports: int, percent: int, milliseconds: int) -> bytes:
    """Turn the motors (bit 0 is A) at a regulated speed; the firmware ends the move and brakes."""
    return b"\xaf" + b"".join(map(number, (0, ports, percent, 0, milliseconds, 0, 1)))


def stop(ports: int) -> bytes:
    """Stop the motors by braking."""
    return b"\xa3" + b"".join(map(number, (0, ports, 1)))


def reset(ports: int) -> bytes:
    """Set the motors' counts to zero and their direction to normal, because another program may
    have reversed the direction."""
    return b"\xa2" + number(0) + number(ports) + b"\xa7" + b"".join(map(number, (0, ports, 1)))


def device_type(port: int, at: int) -> bytes:
    """Read which device is at a port. The result is two bytes at offset `at`: type and mode."""
    return b"\x99" + number(0x05) + number(0) + number(port) + result(at) + result(at + 1)


def sensor(port: int, kind: int, at: int) -> bytes:
    """Read a sensor in its mode 0: a distance in cm, or 1 for a pressed touch sensor. The result
    is a float at offset `at`."""
    asked = b"".join(map(number, (0x1D, 0, port, kind, 0, 1)))
    return b"\x99" + asked + result(at)


def motor_count(port: int, at: int) -> bytes:
    """Read the angle of a motor (0 is A), in degrees. The result is an integer of four
    bytes at offset `at`."""
    return b"\xb3" + number(0) + number(port) + result(at)


def battery(at: int) -> bytes:
    """Read the battery's charge, in percent. The result is one byte at offset `at`."""
    return b"\x81" + number(0x12) + result(at)


def light(pattern: int) -> bytes:
    """Colour the buttons: 1 green, 2 red, 3 orange."""
    return b"\x82" + number(0x1B) + number(pattern)
