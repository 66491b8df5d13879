#!/bin/sh
# djitellopy 2.5.0: after one late answer, each question gets the answer to the previous one, and a move is made
# twice.
#
# Guess before running: an answer that arrives after its timeout is discarded, and the next question gets its own
# answer.
# Outcome: wrong. The late answer is kept, and the next question gets it immediately: the speed is the battery's 87,
# the flight time is the speed, and so on. move_forward(20) then gets a reading instead of "ok", interprets it as a
# failure, and sends "forward 20" again, so the drone is told twice to fly 20 cm. No error is raised.
#
# For this reason, our connection to an EV3 with LEGO's own firmware is closed after a missed answer.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check --no-deps djitellopy==2.5.0 av==18.1.0 \
  numpy==2.4.6 opencv-python-headless==5.0.0.93 pillow==13.0.0
"$folder/env/bin/python" - <<'PY'
import logging
import socket
import threading
import time

from djitellopy import Tello

LATE_S = Tello.RESPONSE_TIMEOUT + 1
ANSWERS = {"battery?": "87", "speed?": "10.0", "time?": "42s", "wifi?": "90"}
Tello.LOGGER.setLevel(logging.CRITICAL)
drone = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
drone.bind(("127.0.0.1", 0))
heard = []


def fly() -> None:
    was_late = False
    while True:
        question, who = drone.recvfrom(100)
        heard.append(question.decode())
        answer = ANSWERS.get(question.decode(), "ok").encode()
        if question == b"battery?" and not was_late:
            was_late = True
            threading.Timer(LATE_S, drone.sendto, (answer, who)).start()
        else:
            drone.sendto(answer, who)


threading.Thread(target=fly, daemon=True).start()
tello = Tello("127.0.0.1")
tello.address = drone.getsockname()
tello.connect(wait_for_state=False)
try:
    tello.query_battery()
    first = "answered"
except Exception as error:
    first = type(error).__name__
time.sleep(2.0)
read = {question: tello.send_read_command(question) for question in ("speed?", "time?", "wifi?", "battery?")}
tello.move_forward(20)
n_moves = heard.count("forward 20")
print("first question:", first, "then:", read, "times told to fly:", n_moves)
assert first != "answered" and n_moves == 2
assert read == {"speed?": "87", "time?": "10.0", "wifi?": "42s", "battery?": "90"}
PY
