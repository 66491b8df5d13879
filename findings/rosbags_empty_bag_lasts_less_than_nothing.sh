#!/bin/sh
# rosbags 0.11.9: a bag without messages has a duration of minus 292 years.
#
# Guess before running: an empty rosbag2, written and read by rosbags itself, has a duration of 0, or reading its
# start and end raises an error.
# Outcome: wrong. AnyReader opens it. start_time is 9223372036854775807 (the year 2262), end_time is 0, and duration
# is -9223372036854775807 ns, which silently falsifies sums and averages.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet rosbags==0.11.9
cd "$folder"
"$folder/env/bin/python" - <<'EOF'
from pathlib import Path

from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Writer

bag = Path("empty")
with Writer(bag, version=9):
    pass
with AnyReader([bag]) as reader:
    found = reader.message_count, reader.start_time, reader.end_time, reader.duration
print(found)
assert found == (0, 2**63 - 1, 0, 1 - 2**63)
EOF
