#!/bin/sh
# python-can 4.6.1: an ASC log that begins at a fraction of .010 s is read back 90 ms late, and messages before its
# first one are moved to the year 2077.
#
# Guess before running: the times of messages that ASCWriter wrote are read back within a millisecond, even if two
# buses are recorded whose messages are not in the order of time.
# Outcome: wrong in both cases. The milliseconds of the beginning are written without leading zeros, so 20.010 s
# becomes "20.10", and with relative_timestamp=False all times are 90 ms late. A log that begins at .001 is 99 ms
# late, and one that begins at .250 is right. If a message of the second bus is 1 ms older than the first message, its
# seconds since 1970 are stored as seconds since the beginning. No error is raised. CSV, TRC and SQLite store all
# times correctly; BLF and .log put the older message at the beginning.
#
# Our robots do not use a CAN bus.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check python-can==4.6.1
cd "$folder"
TZ=UTC "$folder/env/bin/python" - <<'PY'
import datetime

import can

BEGUN_S = 1_700_000_000


def read_back(name: str, written: list[tuple[float, int]]) -> list[float]:
    with can.Logger(name) as log:
        for time_s, bus in written:
            log(can.Message(timestamp=time_s, channel=bus, arbitration_id=1, data=[1], is_extended_id=False))
    if name.endswith(".asc"):
        return [message.timestamp for message in can.ASCReader(name, relative_timestamp=False)]
    return [message.timestamp for message in can.LogReader(name)]


for milliseconds, late_ms in ((1, 99), (10, 90), (250, 0)):
    time_s = BEGUN_S + milliseconds / 1000
    found = round(1000 * (read_back("one.asc", [(time_s, 0)])[0] - time_s))
    print(f"a log that begins at .{milliseconds:03d} s is {found} ms late")
    assert found == late_ms
two = [(BEGUN_S + 0.250, 0), (BEGUN_S + 0.249, 1)]
older = {kind: read_back(f"two.{kind}", two)[1] for kind in ("asc", "csv", "trc", "db", "blf", "log")}
for kind, time_s in older.items():
    print(f"{kind:4} {datetime.datetime.fromtimestamp(time_s, datetime.UTC):%Y-%m-%d %H:%M:%S.%f}")
assert abs(older["asc"] - (2 * BEGUN_S + 0.499)) < 0.01
assert all(abs(older[kind] - two[1][0]) < 0.0005 for kind in ("csv", "trc", "db"))
assert all(abs(older[kind] - two[0][0]) < 0.0005 for kind in ("blf", "log"))
PY
