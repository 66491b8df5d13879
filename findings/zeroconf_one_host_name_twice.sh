#!/usr/bin/env bash
# zeroconf 0.154.0 (PyPI): two computers keep the same host name, and a query for it returns only the first answer.
#
# Guess before running: `register_service` probes only the name of the service, so both computers keep the host name,
# although RFC 6762 (8.1) requires each computer to probe it, too.
# Outcome: right; nothing is raised or renamed.
# Second guess: `AddressResolver.request` waits for the whole given time, and then lists both addresses.
# Outcome: wrong. It returns with the first answer after some milliseconds, and lists one address. The other address
# arrives a little later, and is found only in the cache.
#
# A computer that needs a host name for itself must therefore repeat the query while it is serving, and must read the
# cache.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check zeroconf==0.154.0

"$folder/venv/bin/python" - <<'PYTHON'
import time

import zeroconf

KIND, HOST, WAIT_MS = "_http._tcp.local.", "same-host-name.local.", 3000
PLACES = ["127.0.0.21", "127.0.0.22"]
responders = [zeroconf.Zeroconf(interfaces=[place]) for place in PLACES]
for responder, place in zip(responders, PLACES, strict=True):
    service = zeroconf.ServiceInfo(
        KIND, f"service at {place}.{KIND}".replace("127.0.0.", "n"), port=80,
        parsed_addresses=[place], server=HOST,
    )
    responder.register_service(service)  # a conflict would raise, or rename
    assert service.server == HOST
print("zeroconf", zeroconf.__version__, "registered", HOST, "for both", PLACES)

asking = zeroconf.Zeroconf(interfaces=["127.0.0.23"])
resolver = zeroconf.AddressResolver(HOST)
start_s = time.monotonic()
assert resolver.request(asking, WAIT_MS)
took_ms = 1000 * (time.monotonic() - start_s)
print(f"one question: {resolver.parsed_addresses()} after {took_ms:.0f} of {WAIT_MS} ms")
assert len(resolver.parsed_addresses()) == 1 and took_ms < WAIT_MS / 2

time.sleep(2.0)
cached = {
    ".".join(map(str, record.address))
    for record in asking.cache.entries_with_name(HOST)
    if isinstance(record, zeroconf.DNSAddress)
}
print("in the cache two seconds later:", sorted(cached))
assert cached == set(PLACES)
for each in (*responders, asking):
    each.close()
PYTHON
