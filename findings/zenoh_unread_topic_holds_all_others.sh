#!/bin/sh
# eclipse-zenoh 1.10.2 (PyPI): a subscriber that nobody reads blocks every other subscriber of the session.
#
# Guess before running: a subscriber without a callback keeps or drops its own messages when it is full, and a
# subscriber of another key still gets its messages immediately.
# Outcome: wrong. Such a subscriber has a FIFO of 256 messages by default. When pictures have filled it, orders to
# stop, which have a callback, do not arrive either, until somebody reads a picture. Then they all arrive at once, too
# late. The publisher does not notice. With zenoh.handlers.RingChannel(1) all orders arrive.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check eclipse-zenoh==1.10.2
cat > "$folder/part.py" <<'EOF'
import json
import socket
import subprocess
import sys
import time

import zenoh


def opened(**endpoints):
    config = zenoh.Config()
    config.insert_json5("mode", '"peer"')
    config.insert_json5("scouting/multicast/enabled", "false")
    for kind in ("listen", "connect"):
        config.insert_json5(f"{kind}/endpoints", json.dumps([endpoints[kind]] if kind in endpoints else []))
    return zenoh.open(config)


if len(sys.argv) > 1:
    session = opened(connect=sys.argv[1])
    time.sleep(2)
    for number in range(400):
        session.put("camera", bytes(1000))
        session.put("stop", str(number))
        time.sleep(0.005)
    time.sleep(3)
    print("sent", flush=True)
    sys.stdin.readline()
    session.close()
    sys.exit()


def arrived(*handler):
    with socket.create_server(("127.0.0.1", 0)) as free:
        place = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    with opened(listen=place) as session:
        orders = []
        stop = session.declare_subscriber("stop", orders.append)
        camera = session.declare_subscriber("camera", *handler)
        sender = subprocess.Popen(
            [sys.executable, __file__, place], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        sender.stdout.readline()
        unread = len(orders)
        for _ in range(30):
            while camera.try_recv() is not None:
                pass
            time.sleep(0.1)
        sender.communicate(b"\n")
        stop.undeclare()
        return unread, len(orders)


found = {"default": arrived(), "ring": arrived(zenoh.handlers.RingChannel(1))}
print("orders arrived while no picture was read, and after:", found)
assert found["default"][0] < 300 < found["default"][1] and found["ring"][0] > 380
EOF
"$folder/env/bin/python" "$folder/part.py"
