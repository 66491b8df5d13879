#!/bin/sh
# lcm 1.5.3 (PyPI): a subscription with a queue of one message keeps the oldest message over UDP, and all messages in
# memory.
#
# Guess before running: with set_queue_capacity(1), a robot that was busy while five velocities arrived handles the
# newest. Its tests see the same over "memq://", LCM's provider for tests within one process.
# Outcome: wrong in both cases. Over "udpm://" the first of the five velocities is handled, and the newer ones are
# dropped, including the final stop. Over "memq://" the capacity has no effect, and all five are handled. Without a
# limit (capacity 0) both handle all five. To use only the newest velocity, a program must handle everything in the
# queue before it drives.
#
# The messages use multicast, and do not leave the computer (ttl=0).
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --no-compile --disable-pip-version-check lcm==1.5.3
"$folder/env/bin/python" - <<'PY'
import os
import time

import lcm

CHANNEL = f"VELOCITY_{os.getpid()}"
VELOCITIES = [b"0.1", b"0.2", b"0.3", b"0.4", b"stop"]


def handled(provider: str, capacity: int) -> list[bytes]:
    """Return what a robot handles after it was busy while the velocities arrived."""
    line, messages = lcm.LCM(provider), []
    subscription = line.subscribe(CHANNEL, lambda channel, data: messages.append(data))
    subscription.set_queue_capacity(capacity)
    for velocity in VELOCITIES:
        line.publish(CHANNEL, velocity)
    time.sleep(2.0)
    while line.handle_timeout(500):
        pass
    return messages


UDP = "udpm://239.255.76.67:7667?ttl=0"
found = {(name, capacity): handled(name, capacity) for name in (UDP, "memq://") for capacity in (0, 1)}
for (name, capacity), messages in found.items():
    print(f"{name}, capacity {capacity}: {messages}")
assert found[UDP, 0] == found["memq://", 0] == VELOCITIES
assert found[UDP, 1] == VELOCITIES[:1]
assert found["memq://", 1] == VELOCITIES
PY
