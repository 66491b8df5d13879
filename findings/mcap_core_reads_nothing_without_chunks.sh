#!/usr/bin/env bash
# @mcap/core 2.2.2 (npm): its reader yields no messages from a file without chunks, and raises no error.
#
# Guess before running: McapIndexedReader reads a file that McapWriter wrote with useChunks: false, or refuses it,
# because it has no index. A small logger writes such files, because it then needs no buffer.
# Outcome: wrong. It opens the file, its statistics count three messages, and readMessages() yields none of them. The
# recording therefore looks empty. McapStreamReader reads all three.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-audit --no-fund @mcap/core@2.2.2
cat > run.mjs <<'JS'
import { McapIndexedReader, McapStreamReader, McapWriter, TempBuffer } from '@mcap/core';

async function read(useChunks) {
  const file = new TempBuffer();
  const writer = new McapWriter({ writable: file, useChunks });
  await writer.start({ profile: '', library: '' });
  const schemaId = await writer.registerSchema({ name: 'pose', encoding: 'jsonschema', data: new Uint8Array() });
  const channelId = await writer.registerChannel({ topic: '/pose', messageEncoding: 'json', schemaId, metadata: new Map() });
  for (const time of [1n, 2n, 3n]) {
    await writer.addMessage({ channelId, sequence: 0, logTime: time, publishTime: time, data: new TextEncoder().encode('{}') });
  }
  await writer.end();
  const indexed = await McapIndexedReader.Initialize({ readable: file });
  let byIndex = 0;
  for await (const _ of indexed.readMessages()) byIndex++;
  const stream = new McapStreamReader();
  stream.append(file.get());
  let byStream = 0;
  for (let record; (record = stream.nextRecord()); ) byStream += record.type === 'Message';
  return [Number(indexed.statistics.messageCount), byIndex, byStream].join(' ');
}

const found = { chunks: await read(true), plain: await read(false) };
console.log('messages counted, read by index, read as a stream:', found);
process.exit(found.chunks === '3 3 3' && found.plain === '3 0 3' ? 0 : 1);
JS
node run.mjs
