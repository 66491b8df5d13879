#!/bin/sh
# pymavlink 2.4.50: a vehicle that was never heard seems to have been heard when the connection was opened.
#
# Guess before running: without any vehicle, time_since("HEARTBEAT") on a new connection is a huge number (the time
# since 1970), or None.
# Outcome: wrong. It is 0.0 s on a new connection and grows from there: 0.2 s after opening it is 0.2. A check for
# "heard within the last second" therefore passes although there is no vehicle.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet pymavlink==2.4.50
cd "$folder"
MAVLINK20=1 "$folder/env/bin/python" - <<'END'
import time

from pymavlink import mavutil

line = mavutil.mavlink_connection("udpin:127.0.0.1:0")
first = line.time_since("HEARTBEAT")
time.sleep(0.2)
later = line.time_since("HEARTBEAT")
print(f"without any vehicle: {first:.3f} s, then {later:.3f} s; messages: {list(line.messages)}")
assert "HEARTBEAT" not in line.messages
assert first < 0.1 and 0.1 < later < 5.0
END
