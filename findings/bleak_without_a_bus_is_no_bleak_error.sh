#!/bin/sh
# bleak 3.1.0 (Linux): if D-Bus is not running, as in a container, scanning raises FileNotFoundError.
#
# Guess before running: BleakScanner.discover() and BleakClient.connect() raise a BleakError that says that Bluetooth
# is not available, since bleak has an exception for this.
# Outcome: wrong for both. They raise the socket's error "No such file or directory", which names neither the file nor
# Bluetooth, and which `except BleakError` does not catch.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check bleak==3.1.0
DBUS_SYSTEM_BUS_ADDRESS="unix:path=$folder/no-bus" "$folder/env/bin/python" - <<'EOF'
import asyncio

from bleak import BleakClient, BleakScanner
from bleak.exc import BleakError


async def raised(call) -> tuple[str, str, bool]:
    try:
        await call()
    except Exception as error:
        return type(error).__name__, str(error), isinstance(error, BleakError)
    return "nothing", "", False


async def main():
    return [await raised(lambda: BleakScanner.discover(timeout=1)), await raised(BleakClient("00:00:00:00:00:01").connect)]


found = asyncio.run(main())
print(found)
assert found == [("FileNotFoundError", "[Errno 2] No such file or directory", False)] * 2
EOF
