#!/usr/bin/env bash
# @serialport/parser-packet-length 13.0.0 (npm): after one byte of noise, no packet with a two-byte header is found.
#
# Guess before running: PacketLengthParser skips bytes until it finds the delimiter, so a byte of noise before a
# packet, or a lost byte, costs one or two packets.
# Outcome: right for a delimiter of one byte, wrong for a delimiter of two (delimiterBytes: 2), which servos and most
# sensors use, such as 0xffff or 0xaa55. One byte that does not belong to a packet ends the search: while the parser
# looks for the header, it keeps the oldest byte and drops the new one, so it never gets past the oldest. Of 20
# packets after a byte of noise, none is found. If the sixth of 20 packets lost a byte, only the packets up to the
# damaged one are found. No error is raised, and no data is passed on. If a robot is switched on before the program
# starts, its position may be lost for the whole session.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
echo '{"private": true, "type": "module"}' > package.json
npm install --silent --no-audit --no-fund --ignore-scripts @serialport/parser-packet-length@13.0.0
cat > run.js <<'JS'
import assert from "node:assert";
import { PacketLengthParser } from "@serialport/parser-packet-length";

const PACKETS = 20;
const NOISE = 0x01;
const KINDS = {
  "one-byte header": [[0xaa], { delimiter: 0xaa, packetOverhead: 2, lengthBytes: 1, lengthOffset: 1 }],
  "two-byte header": [
    [0xaa, 0x55],
    { delimiter: 0xaa55, delimiterBytes: 2, packetOverhead: 3, lengthBytes: 1, lengthOffset: 2 },
  ],
};

/** Count the packets that the parser finds. */
function count(options, bytes) {
  let packets = 0;
  const parser = new PacketLengthParser(options);
  parser.on("data", () => packets++);
  parser.write(Buffer.from(bytes));
  return packets;
}

const found = {};
for (const [name, [header, options]] of Object.entries(KINDS)) {
  const packets = Array.from({ length: PACKETS }, (_, number) => [...header, 2, number, number]);
  const whole = packets.flat();
  const lost = packets.map((packet, number) => (number === 5 ? packet.slice(0, -1) : packet)).flat();
  found[name] = [count(options, whole), count(options, [NOISE, ...whole]), count(options, lost)];
  console.log(`${name}: ${found[name][0]} packets, ${found[name][1]} after noise, ${found[name][2]} with a byte lost`);
}
assert.deepEqual(found["two-byte header"], [PACKETS, 0, 6]);
assert.deepEqual(found["one-byte header"].slice(0, 2), [PACKETS, PACKETS]);
assert.ok(found["one-byte header"][2] >= PACKETS - 2);
JS
node run.js
