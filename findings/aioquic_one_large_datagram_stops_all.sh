#!/bin/sh
# aioquic 1.7.2: a datagram larger than a packet is never sent, and neither is any later datagram.
#
# Guess before running: send_datagram_frame() refuses or drops data that cannot fit. Both sides allow 65536 bytes.
# Outcome: wrong. The call raises no error, keeps the data at the head of its queue, and tries to send it forever. A
# small picture of 1200 bytes thus blocks all later velocities that are sent as datagrams, until the connection ends.
# Streams and pings still work, so the connection looks healthy, and the queue grows. A datagram of 1170 bytes is
# sent.
#
# Our connections do not use QUIC.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check aioquic==1.7.2 cryptography==50.0.2
"$folder/env/bin/python" - <<'PY'
import asyncio
import datetime
import ssl

from aioquic.asyncio import QuicConnectionProtocol, connect, serve
from aioquic.quic.configuration import QuicConfiguration
from aioquic.quic.events import DatagramFrameReceived, QuicEvent, StreamDataReceived
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

heard: list[tuple[str, int]] = []


class Robot(QuicConnectionProtocol):
    def quic_event_received(self, event: QuicEvent) -> None:
        if isinstance(event, DatagramFrameReceived):
            heard.append(("datagram", len(event.data)))
        elif isinstance(event, StreamDataReceived):
            heard.append(("stream", len(event.data)))


def settings(**more: object) -> QuicConfiguration:
    return QuicConfiguration(alpn_protocols=["drive"], max_datagram_frame_size=65536, **more)


def certified() -> QuicConfiguration:
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "localhost")])
    now, day = datetime.datetime.now(datetime.timezone.utc), datetime.timedelta(days=1)
    builder = x509.CertificateBuilder(name, name, key.public_key(), 1, now - day, now + day)
    return settings(is_client=False, certificate=builder.sign(key, hashes.SHA256()), private_key=key)


async def main() -> None:
    server = await serve("127.0.0.1", 0, configuration=certified(), create_protocol=Robot)
    port = server._transport.get_extra_info("sockname")[1]
    trusting = settings(is_client=True, verify_mode=ssl.CERT_NONE)
    async with connect("127.0.0.1", port, configuration=trusting) as line:
        for n_bytes in (20, 1170, 1200, *[20] * 50):
            line._quic.send_datagram_frame(bytes(n_bytes))
            line.transmit()
            await asyncio.sleep(0.02)
        _, writer = await line.create_stream()
        writer.write(b"stop")
        await asyncio.wait_for(line.ping(), 5.0)
        await asyncio.sleep(1.0)
        print("heard:", heard)
    server.close()


asyncio.run(main())
assert heard == [("datagram", 20), ("datagram", 1170), ("stream", 4)]
PY
