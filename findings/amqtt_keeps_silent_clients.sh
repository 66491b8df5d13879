#!/bin/sh
# amqtt 0.12.1: the broker never disconnects a silent client, so the client's last will is not published.
#
# Guess before running: a robot that requested a keep-alive of 2 s and then loses its connection is disconnected
# within 3 s (MQTT 3.1.1, 3.1.2.10: one and a half times the keep-alive). Its last will then informs the other
# clients.
# Outcome: wrong. The read timeout of the broker's handler does nothing and waits again, so nothing has happened after
# twelve seconds. If a connection is closed without DISCONNECT, the will is published immediately. A test that kills
# the robot's program therefore passes, but a robot that leaves the Wi-Fi or whose battery is empty stays "online".
#
# Our robots do not use MQTT: each robot stops by itself when commands or pictures stop arriving.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check amqtt==0.12.1
"$folder/env/bin/python" -W ignore - <<'PY'
import asyncio
import logging

from amqtt.broker import Broker
from amqtt.client import MQTTClient

KEEP_ALIVE_S, WAITED_S = 2, 12
logging.disable(logging.CRITICAL)


def text(value: str) -> bytes:
    return len(value).to_bytes(2, "big") + value.encode()


def connect_with_will(name: str) -> bytes:
    clean_session_and_will = b"\x06"
    body = text("MQTT") + b"\x04" + clean_session_and_will + KEEP_ALIVE_S.to_bytes(2, "big")
    body += text(name) + text(f"gone/{name}") + text("gone")
    return b"\x10" + bytes([len(body)]) + body


async def main() -> None:
    anonymous = {"amqtt.plugins.authentication.AnonymousAuthPlugin": {"allow_anonymous": True}}
    listener = {"type": "tcp", "bind": "127.0.0.1:0"}
    broker = Broker({"listeners": {"default": listener}, "plugins": anonymous})
    await broker.start()
    port = broker._servers["default"].instance.sockets[0].getsockname()[1]
    watcher = MQTTClient()
    await watcher.connect(f"mqtt://127.0.0.1:{port}")
    await watcher.subscribe([("gone/#", 0)])
    lines = {}
    for name in ("silent", "closed"):
        lines[name] = reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(connect_with_will(name))
        assert await reader.readexactly(4) == b"\x20\x02\x00\x00", "accepted"
    lines["closed"][1].close()
    heard = []
    try:
        while True:
            heard.append((await watcher.deliver_message(timeout_duration=WAITED_S)).topic)
    except TimeoutError:
        pass
    try:
        is_closed = await asyncio.wait_for(lines["silent"][0].read(1), 1.0) == b""
    except TimeoutError:
        is_closed = False
    print(f"keep-alive {KEEP_ALIVE_S} s, waited {WAITED_S} s, wills: {heard}; silent line closed: {is_closed}")
    assert heard == ["gone/closed"] and not is_closed
    await watcher.disconnect()
    await broker.shutdown()


asyncio.run(main())
PY
