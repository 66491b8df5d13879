#!/bin/sh
# feetech-servo-sdk 1.0.0: creating a handler for a second kind of servo swaps the bytes of the first kind.
#
# Guess before running: PacketHandler(0), for servos of the STS series, and PacketHandler(1), for the SCS series, each
# keep their own byte order.
# Outcome: wrong. The byte order is one variable of the module, and the newest handler sets it for all. Position 2048,
# the middle, is then sent to the STS servo as 8, which is one end of its range, and the servo's reports are read with
# swapped bytes. The checksum is valid, so the servo obeys.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check feetech-servo-sdk==1.0.0 pyserial==3.5
"$folder/env/bin/python" - <<'PY'
import os
import pty
import tty

from scservo_sdk import PacketHandler, PortHandler

GOAL_POSITION, MIDDLE = 42, 2048
servo, end = pty.openpty()
tty.setraw(servo)
tty.setraw(end)
port = PortHandler(os.ttyname(end))
assert port.openPort()


def heard(handler) -> bytes:
    handler.write2ByteTxOnly(port, 1, GOAL_POSITION, MIDDLE)
    packet = os.read(servo, 100)
    assert sum(packet[2:]) & 0xFF == 0xFF, "the checksum fits"
    return packet[-3:-1]


sts = PacketHandler(0)
before = heard(sts)
scs = PacketHandler(1)
after = heard(sts)
print("STS servo hears", *(int.from_bytes(value, "little") for value in (before, after)))
assert before == b"\x00\x08" and after == b"\x08\x00"
PY
