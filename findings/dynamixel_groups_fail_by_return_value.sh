#!/bin/sh
# dynamixel-sdk 4.1.0 (PyPI): a group keeps the first goal, and one silent servo makes all positions 0.
#
# Guess before running: GroupSyncWrite.addParam() replaces the goal of a servo that is already in the group. If one
# servo does not answer a GroupSyncRead, the positions of the others are read.
# Outcome: wrong in both cases, and no error is raised. addParam() returns False and keeps the old goal, which
# txPacket() successfully sends again. A loop that adds and sends goals therefore always drives to the first goal.
# Only changeParam() or clearParam() helps. A silent servo ends the reading, and getData() then returns 0 for every
# servo, even for those that answered before it. Code that does not check isAvailable() calculates with joints at 0.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check dynamixel-sdk==4.1.0 pyserial==3.5
"$folder/env/bin/python" - <<'PY'
import os
import pty
import threading
import tty

from dynamixel_sdk import COMM_SUCCESS, GroupSyncRead, GroupSyncWrite, PacketHandler, PortHandler

GOAL, POSITION, WIDTH, SYNC_READ, STATUS = 116, 132, 4, 0x82, 0x55
bus, end = pty.openpty()
tty.setraw(bus)
tty.setraw(end)
port, handler = PortHandler(os.ttyname(end)), PacketHandler(2.0)
assert port.openPort()
positions, goals, silent = {1: 1000, 2: 2000, 3: 3000}, [], set()


def read_all(n_bytes: int) -> bytes:
    data = b""
    while len(data) < n_bytes:
        data += os.read(bus, n_bytes - len(data))
    return data


def obey() -> None:
    while True:
        head = read_all(7)
        body = read_all(int.from_bytes(head[5:7], "little"))
        if body[0] != SYNC_READ:
            goals.append(int.from_bytes(body[6:10], "little"))
            continue
        for servo, position in positions.items():
            if servo not in silent:
                answer = [0xFF, 0xFF, 0xFD, 0, servo, 8, 0, STATUS, 0, *position.to_bytes(WIDTH, "little")]
                checksum = handler.updateCRC(0, [*answer, 0, 0], len(answer))
                os.write(bus, bytes(answer) + checksum.to_bytes(2, "little"))


threading.Thread(target=obey, daemon=True).start()
writes, reads = GroupSyncWrite(port, handler, GOAL, WIDTH), GroupSyncRead(port, handler, POSITION, WIDTH)


def add(goal: int) -> bool:
    return writes.addParam(1, list(goal.to_bytes(WIDTH, "little")))


assert add(500) and writes.txPacket() == COMM_SUCCESS
was_taken = add(900)
assert writes.txPacket() == COMM_SUCCESS
for servo in positions:
    assert reads.addParam(servo)


def read() -> list[int]:
    reads.txRxPacket()
    return [reads.getData(servo, POSITION, WIDTH) for servo in positions]


well = read()
silent.add(3)
one_silent = read()
print("goals heard:", goals, "second one taken:", was_taken, "positions:", well, "with servo 3 silent:", one_silent)
assert goals == [500, 500] and was_taken is False
assert well == [1000, 2000, 3000] and one_silent == [0, 0, 0]
PY
