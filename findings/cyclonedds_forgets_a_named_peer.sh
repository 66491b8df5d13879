#!/usr/bin/env bash
# cyclonedds 11.0.1 (PyPI): a peer in the configuration is never found if it is switched on 31 s later.
#
# Guess before running: with multicast off and a `<Peer Address="127.0.0.1"/>`, as for a robot on a Wi-Fi that blocks
# multicast, discovery messages are sent to the peer at each SPDPInterval. The peer is therefore found within seconds
# of its start, whenever it starts.
# Outcome: wrong. After 30 s without an answer the peer's address is dropped (`PruneDelay`), although a person
# configured it. A robot that does not know our address is then found only after our program is restarted.
# `PruneDelay="inf"` has the expected effect. (A peer on the same computer contacts us by itself, unless AddLocalhost
# is false.)
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check cyclonedds==11.0.1
cat > "$folder/part.py" <<'PY'
import sys
import time
from dataclasses import dataclass

from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic


@dataclass
class Number(IdlStruct, typename="Number"):
    value: int


def configuration(discovery):
    return (
        '<CycloneDDS><Domain><General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>'
        "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
        f"<SPDPInterval>1 s</SPDPInterval>{discovery}</Discovery></Domain></CycloneDDS>"
    )


role, domain_id, discovery = sys.argv[1], int(sys.argv[2]), sys.argv[3]
domain = Domain(domain_id, configuration(discovery))
participant = DomainParticipant(domain_id)
topic = Topic(participant, "numbers", Number)
if role == "late":
    reader = DataReader(participant, topic)
    time.sleep(600)
writer = DataWriter(participant, topic)
print("asks", flush=True)
until = time.monotonic() + 50
while time.monotonic() < until and not writer.get_matched_subscriptions():
    time.sleep(0.1)
print("found" if writer.get_matched_subscriptions() else "not found", flush=True)
PY
python=$folder/venv/bin/python
try() { # DOMAIN PEER -> found or not, by a program that started 33 s before its peer
  "$python" "$folder/part.py" asks "$1" "<Peers>$2</Peers>" > "$folder/said$1" & local asks=$!
  sleep 33
  "$python" "$folder/part.py" late "$1" '<Peers AddLocalhost="false"/>' & local late=$!
  wait "$asks"
  kill "$late"; wait "$late" 2> /dev/null || true
}
try 71 '<Peer Address="127.0.0.1"/>' & first=$!
try 72 '<Peer Address="127.0.0.1" PruneDelay="inf"/>' & second=$!
wait "$first" "$second"
usual=$(tail -1 "$folder/said71"); for_ever=$(tail -1 "$folder/said72")
echo "cyclonedds 11.0.1: a named peer that comes after 33 s: $usual; with PruneDelay=inf: $for_ever"
[ "$usual" = "not found" ] && [ "$for_ever" = "found" ]
