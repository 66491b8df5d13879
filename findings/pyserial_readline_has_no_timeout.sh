#!/bin/sh
# pyserial 3.5: with a timeout of half a second, readline() still waits as long as bytes arrive.
#
# Guess before running: with timeout=0.5, readline() returns after half a second what it has received, and so does
# read_until().
# Outcome: wrong for readline(). The timeout starts again with each byte, because it belongs to the one-byte read()
# that Python's own readline() calls. A microcontroller that sends 'x' ten times a second without an end of line, for
# example at the wrong baud rate, blocks the control loop forever. read_until() returns after half a second.
#
# Our programs do not use this library.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check pyserial==3.5
"$folder/env/bin/python" - <<'PY'
import os
import pty
import threading
import time
import tty

import serial

TIMEOUT_S, SENT_FOR_S = 0.5, 4.0
microcontroller, end = pty.openpty()
tty.setraw(microcontroller)
tty.setraw(end)
line = serial.Serial(os.ttyname(end), 115200, timeout=TIMEOUT_S)


def send() -> None:
    for _ in range(int(SENT_FOR_S * 10)):
        os.write(microcontroller, b"x")
        time.sleep(0.1)


def lasted_s(read) -> float:
    sender = threading.Thread(target=send)
    sender.start()
    began_s = time.monotonic()
    got = read()
    ended_s = time.monotonic()
    sender.join()
    line.reset_input_buffer()
    assert got and not got.strip(b"x")
    return ended_s - began_s


found = {read.__name__: round(lasted_s(read), 1) for read in (line.readline, line.read_until)}
print("timeout", TIMEOUT_S, "s; seconds:", found)
assert found["readline"] > SENT_FOR_S > 3 * found["read_until"]
PY
