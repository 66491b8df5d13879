#!/bin/sh
# aiomqtt 2.5.1 (paho-mqtt 2.2.0, amqtt 0.12.1): a queue of one message keeps the oldest message, so the robot loses
# the stop.
#
# Guess before running: with max_queued_incoming_messages=1, a robot that was busy for a moment gets the newest
# velocity. With QoS 1 it may also get all velocities, because the broker resends what was not accepted.
# Outcome: wrong. Of the velocities 0.5, 0.4 and 0.0 the robot gets 0.5. While the queue is full, the library discards
# each new message, even the stop. It still acknowledges the message to the broker, and only writes a line to the log.
# Without the option nothing is lost, but the robot first drives through all old velocities. With a custom queue
# (queue_type) that drops the oldest message when it is full, the robot gets 0.0.
#
# Our robots do not use MQTT.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check aiomqtt==2.5.1 paho-mqtt==2.2.0 amqtt==0.12.1
"$folder/env/bin/python" -W ignore - <<'PY'
import asyncio
import logging

import aiomqtt
from amqtt.broker import Broker

VELOCITIES = ("0.5", "0.4", "0.0")


class Newest(asyncio.Queue):
    def put_nowait(self, message: aiomqtt.Message) -> None:
        if self.full():
            self.get_nowait()
        super().put_nowait(message)


class Lines(logging.Handler):
    def __init__(self) -> None:
        super().__init__()
        self.told: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.told.append(record.getMessage())


async def heard_after_a_pause(port: int, **options) -> tuple[list[str], list[str]]:
    lines, log = Lines(), logging.Logger("robot")
    log.addHandler(lines)
    heard = []
    robots = aiomqtt.Client("127.0.0.1", port, logger=log, **options)
    async with robots as robot, aiomqtt.Client("127.0.0.1", port) as phone:
        await robot.subscribe("velocity", qos=1)
        for velocity in VELOCITIES:
            await phone.publish("velocity", velocity, qos=1)
        await asyncio.sleep(3.0)
        try:
            async with asyncio.timeout(3.0):
                async for message in robot.messages:
                    heard.append(message.payload.decode())
        except TimeoutError:
            pass
    return heard, lines.told


async def main() -> None:
    anonymous = {"amqtt.plugins.authentication.AnonymousAuthPlugin": {"allow_anonymous": True}}
    listener = {"type": "tcp", "bind": "127.0.0.1:0"}
    broker = Broker({"listeners": {"default": listener}, "plugins": anonymous})
    await broker.start()
    port = broker._servers["default"].instance.sockets[0].getsockname()[1]
    one, told = await heard_after_a_pause(port, max_queued_incoming_messages=1)
    every, _ = await heard_after_a_pause(port)
    newest, _ = await heard_after_a_pause(port, max_queued_incoming_messages=1, queue_type=Newest)
    discarded = [line for line in told if "full" in line]
    print(f"a queue of one: {one}, log: {discarded}; no limit: {every}; own queue: {newest}")
    assert one == ["0.5"] and len(discarded) == 2
    assert every == list(VELOCITIES) and newest == ["0.0"]
    await broker.shutdown()


logging.getLogger("amqtt").setLevel(logging.CRITICAL)
logging.getLogger("transitions").setLevel(logging.CRITICAL)
asyncio.run(main())
PY
