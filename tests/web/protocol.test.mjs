// The page's codec is tested with the same messages as the server's (tests/vectors/wire.json).

import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';

import * as protocol from '../../web/js/protocol.js';

const vectors = JSON.parse(readFileSync(new URL('../vectors/wire.json', import.meta.url), 'utf8'));
const bytes = (hex) => new Uint8Array(Buffer.from(hex, 'hex')).buffer;
const hex = (buffer) => Buffer.from(buffer).toString('hex');
const refuses = (code) => (error) => error instanceof protocol.ProtocolError && error.code === code;

for (const { name, hex: message, picture, error } of vectors.pictures) {
  test(`picture: ${name}`, () => {
    if (error) {
      assert.throws(() => protocol.parsePicture(bytes(message)), refuses(error));
      return;
    }
    const expected = {
      frameId: picture.frame_id,
      capturedMs: picture.captured_ms,
      encoding: picture.encoding,
      width: picture.width,
      height: picture.height,
      data: new Uint8Array(bytes(picture.data_hex)),
      quiet: picture.quiet,
      nonce: picture.nonce,
    };
    assert.deepEqual(protocol.parsePicture(bytes(message)), expected);
    assert.equal(hex(protocol.encodePicture(expected)), message);
  });
}

for (const { frame_id: frameId, hex: message } of vectors.acknowledgements) {
  test(`acknowledgement of frame ${frameId}`, () => {
    assert.equal(hex(protocol.encodeAcknowledgement(frameId)), message);
    assert.equal(protocol.parseAcknowledgement(bytes(message)), frameId);
  });
}

for (const { name, hex: message, error } of vectors.refused_acknowledgements) {
  test(`refused acknowledgement: ${name}`, () => {
    assert.throws(() => protocol.parseAcknowledgement(bytes(message)), refuses(error));
  });
}

function encode(word) {
  if (word.type === 'drive') return protocol.encodeDrive({ ...word, frameAgeMs: word.frame_age_ms, phoneMs: word.phone_ms });
  if (word.type === 'mode') return protocol.encodeMode(word.mode, word.seq, word);
  if (word.type === 'ping') return protocol.encodePing(word.client_ms);
  if (word.type === 'release') return protocol.encodeRelease(word.stop_number);
  return protocol.encodeWord(word.type);
}

for (const word of vectors.up) {
  test(`up: ${JSON.stringify(word)}`, () => assert.deepEqual(JSON.parse(encode(word)), word));
}

for (const word of vectors.down ?? []) {
  test(`down: ${word.type}`, () => assert.deepEqual(protocol.parseWords(JSON.stringify(word)), word));
}

test('anything that is not a message is refused', () => {
  for (const text of ['', 'state', '[]', 'null', '{}', '{"type": 3}']) {
    assert.throws(() => protocol.parseWords(text), refuses('malformed'));
  }
});
