#!/bin/sh
# roslibpy 2.1.0: velocities that were published while the robot was out of reach are all sent when it is back.
#
# Guess before running: publish() without a connection raises an error or drops the message; at most the last message
# is kept.
# Outcome: wrong. All messages are kept, without a limit, and are sent at once when the connection is back, the first
# ones even before the topic is advertised again. publish() reports no error. A robot that was out of reach for a
# minute then gets the velocities of a minute, and drives on until the last of them times out.
#
# Our bridge to ROS refuses a command while there is no connection.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check roslibpy==2.1.0 websockets==15.0.1
"$folder/env/bin/python" - <<'PY'
import asyncio
import json
import os
import threading
import time

import roslibpy
from websockets.asyncio.server import Server, ServerConnection, serve

heard: list[tuple[str, float | None]] = []
events = asyncio.new_event_loop()
threading.Thread(target=events.run_forever, daemon=True).start()


async def hear(connection: ServerConnection) -> None:
    async for text in connection:
        message = json.loads(text)
        heard.append((message["op"], message.get("msg", {}).get("linear", {}).get("x")))


async def open_bridge(port: int) -> Server:
    return await serve(hear, "127.0.0.1", port)


async def close_bridge(bridge: Server) -> None:
    bridge.close()
    await bridge.wait_closed()


def run(work):
    return asyncio.run_coroutine_threadsafe(work, events).result()


def wait_until(is_so) -> None:
    until_s = time.monotonic() + 30.0
    while not is_so():
        assert time.monotonic() < until_s
        time.sleep(0.05)


bridge = run(open_bridge(0))
port = bridge.sockets[0].getsockname()[1]
ros = roslibpy.Ros("127.0.0.1", port)
ros.run()
topic = roslibpy.Topic(ros, "/cmd_vel", "geometry_msgs/Twist")


def publish(speed: float) -> None:
    topic.publish(roslibpy.Message({"linear": {"x": speed}}))


publish(0.1)
wait_until(lambda: len(heard) == 2)
run(close_bridge(bridge))
wait_until(lambda: not ros.is_connected)
heard.clear()
old = [0.2, 0.3, 0.4, 0.5, 0.6]
for speed in old:
    publish(speed)
    time.sleep(0.1)
run(open_bridge(port))
wait_until(lambda: ros.is_connected)
time.sleep(1.0)
publish(0.0)
wait_until(lambda: heard and heard[-1][1] == 0.0)
print("heard after the connection is back:", heard)
assert [speed for op, speed in heard if op == "publish"] == [*old, 0.0]
os._exit(0)
PY
