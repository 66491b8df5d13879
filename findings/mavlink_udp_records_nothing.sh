#!/bin/sh
# pymavlink 2.4.50: setup_logfile() records nothing on a UDP connection.
#
# Guess before running: after close(), the .tlog of a udpin connection contains all 30 messages that arrived.
# Outcome: wrong. The file stays empty, even after a flush, and there is no error. Over TCP the same messages are
# recorded. Simulators, companion computers and telemetry bridges usually use UDP.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet pymavlink==2.4.50
cd "$folder"
MAVLINK20=1 "$folder/env/bin/python" - <<'END'
import os
import socket

from pymavlink import mavutil


def recorded(line, rover, name):
    line.setup_logfile(name)
    came = 0
    for load in range(30):
        rover.mav.sys_status_send(0, 0, 0, load, 12000, 1, 50, 0, 0, 0, 0, 0, 0)
        came += line.recv_match(type="SYS_STATUS", blocking=True, timeout=5.0) is not None
    line.logfile.flush()
    return came, os.path.getsize(name)


udp = mavutil.mavlink_connection("udpin:127.0.0.1:0")
port = udp.port.getsockname()[1]
by_udp = recorded(udp, mavutil.mavlink_connection(f"udpout:127.0.0.1:{port}"), "udp.tlog")
with socket.create_server(("127.0.0.1", 0)) as free:
    port = free.getsockname()[1]
tcp = mavutil.mavlink_connection(f"tcpin:127.0.0.1:{port}")
by_tcp = recorded(tcp, mavutil.mavlink_connection(f"tcp:127.0.0.1:{port}"), "tcp.tlog")
print(f"messages and recorded bytes: UDP {by_udp}, TCP {by_tcp}")
assert by_udp == (30, 0)
assert by_tcp[0] == 30 and by_tcp[1] > 30 * 20
END
