#!/bin/sh
# canopen 2.4.1 (python-can 4.6.1): a motor controller that no longer sends heartbeats remains "OPERATIONAL".
#
# Guess before running: if a node sent a heartbeat ten times a second and has been silent for two seconds,
# node.nmt.state is unknown, or reading it raises an error.
# Outcome: wrong. The state is always that of the last heartbeat, and no part of the library compares the heartbeat's
# age with the heartbeat time. A robot that checks the state before it drives off may therefore drive with a wheel
# that has no power. Only wait_for_heartbeat(timeout) raises an error; `node.nmt.timestamp` is the time of the last
# heartbeat by the bus's clock.
#
# Our robots do not use a CAN bus.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check canopen==2.4.1 python-can==4.6.1
"$folder/env/bin/python" - <<'PY'
import time

import canopen
from canopen.nmt import NmtError
from canopen.objectdictionary import ODVariable, datatypes

NODE, HEARTBEAT_MS, SILENT_S = 5, 100, 2.0


def network() -> canopen.Network:
    made = canopen.Network()
    made.connect(interface="virtual", channel="finding")
    return made


dictionary = canopen.ObjectDictionary()
heartbeat = ODVariable("Producer heartbeat time", 0x1017, 0)
heartbeat.data_type, heartbeat.default = datatypes.UNSIGNED16, HEARTBEAT_MS
dictionary.add_object(heartbeat)
robot, motor = network(), network()
motor_itself, motor_seen = motor.create_node(NODE, dictionary), robot.add_node(NODE, dictionary)
motor_itself.nmt.start_heartbeat(HEARTBEAT_MS)
motor_seen.nmt.state = "OPERATIONAL"
for _ in range(10):
    motor_seen.nmt.wait_for_heartbeat(timeout=10.0)
alive = motor_seen.nmt.state
motor_itself.nmt.stop_heartbeat()
motor.disconnect()
time.sleep(SILENT_S)
silent = motor_seen.nmt.state
try:
    motor_seen.nmt.wait_for_heartbeat(timeout=0.5)
    waited = "heard"
except NmtError as error:
    waited = str(error)
robot.disconnect()
print(f"alive: {alive}; silent for {SILENT_S} s: {silent}; wait_for_heartbeat: {waited}")
assert alive == silent == "OPERATIONAL" and waited != "heard"
PY
