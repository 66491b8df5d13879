"""Runs the third-party client `ev3-dc`, and prints what it receives and sends, as JSON."""

from __future__ import annotations

import json
import struct
import sys
import time
from typing import Any

import ev3_dc as ev3


def encodings() -> dict[str, Any]:
    """Its encoding of constants and of the locations of results."""
    values = [0, 1, -1, 31, 32, -31, -32, 127, 128, -127, -128, 400, 32767, 32768, -32768, 2**30]
    return {
        "numbers": {str(value): ev3.LCX(value).hex() for value in values},
        "results": {str(index): ev3.GVX(index).hex() for index in (0, 4, 31, 32, 40)},
    }


def drive(serial: str) -> dict[str, Any]:
    """Connect by Wi-Fi, read sensors, and turn two motors for 450 ms."""
    with ev3.EV3(protocol=ev3.WIFI, host=serial) as brick:
        asked = b""
        for port, kind, at in ((0, 16, 0), (3, 30, 4)):
            numbers = b"".join(map(ev3.LCX, (0, port, kind, 0, 1)))
            asked += ev3.opInput_Device + ev3.READY_SI + numbers + ev3.GVX(at)
        asked += ev3.opUI_Read + ev3.GET_LBATT + ev3.GVX(8)
        reply = brick.send_direct_cmd(asked, global_mem=9, sync_mode=ev3.SYNC)
        told = dict(zip(("touch", "cm", "percent"), struct.unpack("<ffB", reply[-9:]), strict=True))
        parts = (0, ev3.PORT_B + ev3.PORT_C, 34, 0, 450, 0, 1)
        brick.send_direct_cmd(
            b"".join((ev3.opOutput_Time_Speed, *(ev3.LCX(part) for part in parts))),
            sync_mode=ev3.SYNC,
        )
        print(json.dumps({"moving": True}), flush=True)
        time.sleep(0.6)
        print(json.dumps({"moving": False}), flush=True)
        sys.stdin.readline()
        brick.send_direct_cmd(
            b"".join((ev3.opOutput_Stop, ev3.LCX(0), ev3.LCX(6), ev3.LCX(1))), sync_mode=ev3.SYNC
        )
    return told


if __name__ == "__main__":
    print(json.dumps(encodings()), flush=True)
    print(json.dumps(drive(sys.argv[1])), flush=True)
