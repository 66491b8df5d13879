#!/bin/sh
# pymavlink 2.4.50: a message sent on a "udpin" connection goes to everybody who has sent to it.
#
# Guess before running: with two vehicles on one udpin port, a message goes to the vehicle that sent last.
# Outcome: wrong. Both vehicles get it. An order to one rover therefore also reaches the other rover, which must check
# target_system itself.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet pymavlink==2.4.50
cd "$folder"
MAVLINK20=1 "$folder/env/bin/python" - <<'END'
from pymavlink import mavutil

line = mavutil.mavlink_connection("udpin:127.0.0.1:0")
port = line.port.getsockname()[1]
rovers = [mavutil.mavlink_connection(f"udpout:127.0.0.1:{port}", source_system=n) for n in (1, 2)]
for rover in rovers:
    rover.mav.heartbeat_send(10, 3, 0, 0, 4)
    assert line.recv_match(type="HEARTBEAT", blocking=True, timeout=5.0) is not None
line.mav.manual_control_send(1, 0, 100, 200, 0, 0)
got = [rover.recv_match(type="MANUAL_CONTROL", blocking=True, timeout=2.0) for rover in rovers]
print([message and message.target for message in got])
assert [message.target for message in got] == [1, 1]
END
