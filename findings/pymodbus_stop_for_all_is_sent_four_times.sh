#!/bin/sh
# pymodbus 3.16.1: a message to all motors is sent four times, and then counts as failed.
#
# Guess before running: write_register(..., device_id=0) on a serial line sends once and returns immediately, since
# address 0 means all devices, and none of them may answer (Modbus over Serial Line 1.02, 2.1).
# Outcome: wrong. It waits for an answer, resends the message after each timeout, four times in all, and then raises
# ModbusIOException. With a timeout of three seconds this takes twelve seconds. A program that stops all motors is
# therefore blocked for that long, and then told that it failed. "20 steps more" for all motors is executed four
# times. no_response_expected=True sends once and returns.
#
# Our robots do not use Modbus.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check pymodbus==3.16.1 pyserial==3.5
"$folder/env/bin/python" - <<'PY'
import logging
import os
import pty
import select
import tty

from pymodbus.client import ModbusSerialClient
from pymodbus.exceptions import ModbusIOException

REQUEST_BYTES = 8
device, end = pty.openpty()
tty.setraw(device)
tty.setraw(end)
logging.disable(logging.CRITICAL)


def sent() -> list[bytes]:
    data = b""
    while select.select([device], [], [], 0.5)[0]:
        data += os.read(device, 1024)
    return [data[begin : begin + REQUEST_BYTES] for begin in range(0, len(data), REQUEST_BYTES)]


motors = ModbusSerialClient(os.ttyname(end), baudrate=115200)
assert motors.connect()
try:
    motors.write_register(1, 20, device_id=0)
    told = "nothing raised"
except ModbusIOException as error:
    told = str(error)
usual = sent()
motors.write_register(1, 20, device_id=0, no_response_expected=True)
unanswered = sent()
print(f"sent {len(usual)} times ({usual[0].hex()}), then: {told}")
print(f"with no_response_expected: {len(unanswered)} time")
assert len(usual) == 4 and len(set(usual)) == 1 and usual[0][0] == 0 and "No response" in told
assert unanswered == usual[:1]
PY
