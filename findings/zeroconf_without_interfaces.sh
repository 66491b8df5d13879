#!/usr/bin/env bash
# zeroconf 0.154.0 (PyPI): a machine without a network announces a service to nobody, and gets no error.
#
# Guess before running: a program that passes on the computer's addresses calls `Zeroconf(interfaces=[])` if the Wi-Fi
# is not connected yet. This raises "No interfaces to listen on", as with `InterfaceChoice.All`.
# Outcome: wrong. The Zeroconf has no socket on which it could send. `register_service` probes, announces and returns
# without an error, but nobody finds the service, not even a second Zeroconf in the same process. An address that is
# assigned later changes nothing, because interfaces are read only once.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check zeroconf==0.154.0
"$folder/venv/bin/python" - <<'PY'
from zeroconf import ServiceInfo, Zeroconf, __version__

KIND = "_http._tcp.local."
about = {"port": 80, "parsed_addresses": ["127.0.0.1"], "server": "rover.local."}
asker = Zeroconf(interfaces=["127.0.0.1"])

def is_found(name):
    return asker.get_service_info(KIND, f"{name}.{KIND}", 2000) is not None

usual = Zeroconf(interfaces=["127.0.0.1"])
usual.register_service(ServiceInfo(KIND, f"usual.{KIND}", **about))
silent = Zeroconf(interfaces=[])
silent.register_service(ServiceInfo(KIND, f"silent.{KIND}", **about))
senders = len(silent.engine.senders)
seen = (senders, is_found("usual"), is_found("silent"))
for one in (asker, usual, silent):
    one.close()
print(f"zeroconf {__version__}: sockets to send on {seen[0]}, usual found {seen[1]}, silent found {seen[2]}")
raise SystemExit(seen != (0, True, False))
PY
