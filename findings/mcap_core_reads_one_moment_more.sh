#!/usr/bin/env bash
# @mcap/core 2.2.2 (npm) and mcap 1.6.0 (PyPI): the same range of times yields more messages in JavaScript than in
# Python.
#
# Guess before running: both official readers exclude the end of the range, so consecutive ranges yield each message
# once.
# Outcome: wrong. `readMessages({endTime})` includes messages at that time, but `iter_messages(end_time=)` (exclusive,
# now deprecated) does not. If a recording of three messages is cut at time 2, its two halves have four messages in
# JavaScript: a picture that was taken at the cut is in both halves.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-audit --no-fund @mcap/core@2.2.2
python3 -m venv env
env/bin/pip install --quiet --disable-pip-version-check mcap==1.6.0
cat > write.py <<'PY'
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

with open("three.mcap", "wb") as file:
    writer = Writer(file, compression=CompressionType.NONE)
    writer.start()
    channel = writer.register_channel("/pose", "json", writer.register_schema("pose", "jsonschema", b"{}"))
    for time_ns in (1, 2, 3):
        writer.add_message(channel, time_ns, b"{}", time_ns)
    writer.finish()
with open("three.mcap", "rb") as file:
    reader = make_reader(file)
    for start, end in ((1, 2), (2, 4)):
        times = [message.log_time for _, _, message in reader.iter_messages(start_time=start, end_time=end)]
        print(f"Python {start} to {end}: {times}")
PY
cat > read.mjs <<'JS'
import { readFile } from 'node:fs/promises';
import { McapIndexedReader } from '@mcap/core';

const bytes = await readFile('three.mcap');
const readable = {
  size: async () => BigInt(bytes.length),
  read: async (offset, size) => new Uint8Array(bytes.subarray(Number(offset), Number(offset + size))),
};
const reader = await McapIndexedReader.Initialize({ readable });
for (const [startTime, endTime] of [[1n, 2n], [2n, 4n]]) {
  const times = [];
  for await (const message of reader.readMessages({ startTime, endTime })) times.push(message.logTime);
  console.log(`JavaScript ${startTime} to ${endTime}: [${times.join(', ')}]`);
}
JS
(env/bin/python -W ignore write.py; node read.mjs) | tee seen
diff seen - <<'SEEN'
Python 1 to 2: [1]
Python 2 to 4: [2, 3]
JavaScript 1 to 2: [1, 2]
JavaScript 2 to 4: [2, 3]
SEEN
