#!/bin/sh
# minimalmodbus 2.1.1: a speed of 0.29 is written as 28 hundredths.
#
# Guess before running: write_register(1, 0.29, 2) writes 29, and read_register(1, 2) then returns 0.29.
# Outcome: wrong. The product, 28.999999999999996, is truncated instead of rounded. Of the values from 0.00 to 1.00 in
# steps of a hundredth, three arrive one too low (0.29, 0.57 and 0.58). A setting of 0.58 that is read and written
# back becomes 0.57 and then 0.56. A program that waits until it reads what it wrote waits forever.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check minimalmodbus==2.1.1 pyserial==3.5
"$folder/env/bin/python" - <<'PY'
import os
import pty
import threading
import tty

import minimalmodbus

device, end = pty.openpty()
tty.setraw(device)
tty.setraw(end)
written = []


def obey() -> None:
    while True:
        request = b""
        while len(request) < 8:
            request += os.read(device, 8 - len(request))
        assert request[1] == 6, "write one register"
        written.append(int.from_bytes(request[4:6], "big"))
        os.write(device, request)


threading.Thread(target=obey, daemon=True).start()
motor = minimalmodbus.Instrument(os.ttyname(end), 1)
motor.serial.baudrate = 115200
motor.serial.timeout = 5.0
for hundredths in range(101):
    motor.write_register(1, hundredths / 100, number_of_decimals=2, functioncode=6)
wrong = {wanted / 100: got for wanted, got in enumerate(written) if got != wanted}
print("written:", wrong)
assert wrong == {0.29: 28, 0.57: 56, 0.58: 57}
PY
