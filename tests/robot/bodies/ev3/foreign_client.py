"""Runs the third-party client `ev3-dc` with a brick, and prints what it encodes and reads."""

from __future__ import annotations

import json
import struct
import sys

import ev3_dc as ev3

NUMBERS = [0, 1, -1, 31, 32, -31, -32, 127, 128, -127, -128, 400, 32767, 32768, -32768, 2**30]


def order(opcode: bytes, *numbers: int) -> bytes:
    return opcode + b"".join(map(ev3.LCX, numbers))


def drive(serial: str) -> tuple[float, float, int]:
    """Connect by Wi-Fi, read touch, distance and battery, turn two motors and stop them."""
    with ev3.EV3(protocol=ev3.WIFI, host=serial) as brick:
        asked = b""
        for port, kind, at in ((0, 16, 0), (3, 30, 4)):
            asked += order(ev3.opInput_Device + ev3.READY_SI, 0, port, kind, 0, 1) + ev3.GVX(at)
        asked += ev3.opUI_Read + ev3.GET_LBATT + ev3.GVX(8)
        reply = brick.send_direct_cmd(asked, global_mem=9, sync_mode=ev3.SYNC)
        for move in (
            order(ev3.opOutput_Time_Speed, 0, ev3.PORT_B + ev3.PORT_C, 34, 0, 450, 0, 1),
            order(ev3.opOutput_Stop, 0, 6, 1),
        ):
            brick.send_direct_cmd(move, sync_mode=ev3.SYNC)
    return struct.unpack("<ffB", reply[-9:])


numbers = {str(value): ev3.LCX(value).hex() for value in NUMBERS}
results = {str(index): ev3.GVX(index).hex() for index in (0, 4, 31, 32, 40)}
print(json.dumps({"numbers": numbers, "results": results, "read": drive(sys.argv[1])}))
