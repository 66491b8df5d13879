#!/usr/bin/env bash
# cyclonedds 11.0.1 (PyPI): waiting for acknowledgements raises an error instead of reporting a timeout.
#
# Guess before running: `DataWriter.wait_for_acks(timeout)` returns True if everything was acknowledged, and False
# after the timeout, as its return type says. `Publisher.wait_for_acks` does the same for all its writers.
# Outcome: wrong for both. After the timeout, the writer raises AttributeError ("type object 'Exception' has no
# attribute 'DDS_RETCODE_TIMEOUT'"). The publisher always raises "Feature unsupported", even if there is nothing to
# wait for. The writer does return True if everything was acknowledged, so a test on one fast computer does not find
# the fault.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check cyclonedds==11.0.1
cat > "$folder/part.py" <<'PY'
import signal
import subprocess
import sys
import time
from dataclasses import dataclass

from cyclonedds.core import DDSException
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.pub import DataWriter, Publisher
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

DOMAIN, SECOND = 73, 1_000_000_000
CONFIGURATION = (
    '<CycloneDDS><Domain><General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>'
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
    '<SPDPInterval>1 s</SPDPInterval><Peers><Peer Address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>'
)
RELIABLE = Qos(Policy.Reliability.Reliable(SECOND), Policy.History.KeepLast(1))


@dataclass
class Number(IdlStruct, typename="Number"):
    value: int


domain = Domain(DOMAIN, CONFIGURATION)
participant = DomainParticipant(DOMAIN)
topic = Topic(participant, "numbers", Number)
if sys.argv[1:] == ["read"]:
    reader = DataReader(participant, topic, RELIABLE)
    time.sleep(600)
publisher = Publisher(participant)
writer = DataWriter(publisher, topic, RELIABLE)
other = subprocess.Popen([sys.executable, __file__, "read"])
try:
    while not writer.get_matched_subscriptions():
        time.sleep(0.1)
    writer.write(Number(1))
    usual = writer.wait_for_acks(5 * SECOND)
    other.send_signal(signal.SIGSTOP)
    writer.write(Number(2))
    try:
        late = repr(writer.wait_for_acks(SECOND // 2))
    except Exception as error:
        late = type(error).__name__
    other.send_signal(signal.SIGCONT)
    try:
        of_publisher = repr(publisher.wait_for_acks(SECOND // 2))
    except DDSException as error:
        of_publisher = "unsupported" if error.code == DDSException.DDS_RETCODE_UNSUPPORTED else str(error)
finally:
    other.kill()
print(f"cyclonedds 11.0.1: acknowledged {usual}; time up: {late}; publisher: {of_publisher}")
raise SystemExit((usual, late, of_publisher) != (True, "AttributeError", "unsupported"))
PY
"$folder/venv/bin/python" "$folder/part.py"
