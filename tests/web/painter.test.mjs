import assert from 'node:assert/strict';
import { test } from 'node:test';

import { Painter } from '../../web/js/painter.js';

const settle = () => new Promise((done) => setImmediate(done));

/** A painter whose decoder takes as long as the test lets it. */
function slowPainter() {
  const drawn = [];
  const acknowledged = [];
  const decoding = [];
  let asked = 0;
  const getContext = () => {
    asked += 1;
    if (asked > 1) throw new Error('Cannot update created context to different thread'); // as in Firefox
    return { drawImage: (bitmap) => drawn.push(bitmap.frame) };
  };
  const canvas = { width: 0, height: 0, getContext };
  const painter = new Painter(canvas, {
    nowMs: () => 7,
    acknowledge: (frame) => acknowledged.push(frame),
    shown: () => {},
    decode: (picture) => new Promise((done, fail) => decoding.push({ done: () => done({ frame: picture.frameId, width: 4, height: 3, close() {} }), fail })),
  });
  const take = (frameId, quiet = false) => painter.take({ frameId, quiet, capturedMs: 1, nonce: 2 });
  return { painter, drawn, acknowledged, decoding, take };
}

test('a picture that arrives while another is drawn replaces the waiting one', async () => {
  const { painter, drawn, acknowledged, decoding, take } = slowPainter();
  for (const frame of [1, 2, 3, 4]) take(frame);
  assert.equal(decoding.length, 1, 'one picture is decoded at a time');
  decoding[0].done();
  await settle();
  decoding[1].done();
  await settle();
  assert.deepEqual(drawn, [1, 4]);
  assert.deepEqual(acknowledged, [1, 4]);
  assert.equal(painter.dropped, 2);
});

test('the next drawn picture also acknowledges a dropped picture', async () => {
  const { acknowledged, decoding, take } = slowPainter();
  take(1, true);
  take(2, false);
  take(3, true);
  decoding[0].done();
  await settle();
  assert.deepEqual(acknowledged, [], 'the first picture wants no acknowledgement');
  decoding[1].done();
  await settle();
  assert.deepEqual(acknowledged, [3], 'the third also acknowledges the second');
});

test('a damaged picture is acknowledged, and the next one is drawn', async () => {
  const { drawn, acknowledged, decoding, take } = slowPainter();
  take(1);
  decoding[0].fail(new Error('no picture'));
  await settle();
  take(2);
  decoding[1].done();
  await settle();
  assert.deepEqual(drawn, [2]);
  assert.deepEqual(acknowledged, [1, 2]);
});

test('each picture that wants an acknowledgement gets it in the end, in any order', async () => {
  for (let seed = 1; seed < 200; seed += 1) {
    const { acknowledged, decoding, take } = slowPainter();
    let dice = seed;
    const draw = () => (dice = (dice * 48271) % 2147483647) / 2147483647;
    let loudest = 0;
    for (let frame = 1; frame <= 20; frame += 1) {
      const quiet = draw() < 0.6;
      if (!quiet) loudest = frame;
      take(frame, quiet);
      if (draw() < 0.4) {
        decoding.at(-1).done();
        await settle();
      }
    }
    for (let i = 0; i < 3; i += 1) {
      decoding.at(-1).done();
      await settle();
    }
    assert.ok((acknowledged.at(-1) ?? 0) >= loudest, `seed ${seed}`);
  }
});
