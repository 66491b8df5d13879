// Reads a recording with the JavaScript library mcap, by its index, and checks all checksums.

import { readFileSync } from 'node:fs';
import { open } from 'node:fs/promises';
import { McapIndexedReader, McapStreamReader } from '@mcap/core';
import { FileHandleReadable } from '@mcap/nodejs';
import { loadDecompressHandlers } from '@mcap/support';

const [, , recording] = process.argv;
const own = new URL('node_modules/@mcap/core/package.json', import.meta.url);
console.log('VERSION', JSON.parse(readFileSync(own, 'utf8')).version);
const decompressHandlers = await loadDecompressHandlers();

console.log('TRY reads with checksums');
const reader = new McapStreamReader({ decompressHandlers, validateCrcs: true });
reader.append(readFileSync(recording));
let messages = 0;
for (let record; (record = reader.nextRecord()); ) if (record.type === 'Message') messages += 1;
if (!reader.done() || messages === 0) throw new Error(`${messages} messages, done: ${reader.done()}`);
console.log('PASSED', `: ${messages} messages`);

console.log('TRY reads from the index');
const indexed = await McapIndexedReader.Initialize({ readable: new FileHandleReadable(await open(recording, 'r')), decompressHandlers });
let found = 0;
for await (const _ of indexed.readMessages()) found += 1;
if (found !== messages) throw new Error(`${found} of ${messages}`);
console.log('PASSED');
process.exit(0);
