import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { Start, YOUNG_MS } from '../../web/js/start.js';

const STOPPED = { mode: 'stopped', you_are_pilot: true, emergency: false };
let start;
let said;
let sight;
let nowMs;
let failures;

beforeEach(() => {
  said = [];
  nowMs = 1000;
  failures = 0;
  sight = { frame: 12, nonce: 7 };
  let seq = 0;
  const connection = { nextSeq: () => ++seq, send: (text) => said.push(JSON.parse(text)) };
  start = new Start(connection, () => sight, () => nowMs);
  start.addEventListener('failed', () => (failures += 1));
});

/** Show a picture, some time later. */
function see(frame, nonce, laterMs = 33) {
  nowMs += laterMs;
  sight = { frame, nonce };
  start.go();
}

test('a start is sent at once if a picture is shown', () => {
  start.ask('train');
  assert.deepEqual(said, [{ type: 'mode', mode: 'train', seq: 1, frame: 12, nonce: 7 }]);
});

test('without a picture, a start waits for the first one', () => {
  sight = { frame: null, nonce: null };
  start.ask('train');
  assert.deepEqual(said, []);
  see(13, 8);
  see(14, 9);
  assert.deepEqual(said.map((word) => word.frame), [13], 'the start is sent once');
});

for (const code of ['stale', 'no_picture', 'unknown_frame']) {
  test(`a start that is refused as ${code} is sent again with the next picture, never with the same`, () => {
    start.ask('autonomous');
    start.refuse({ code, seq: 1 });
    start.go();
    assert.equal(said.length, 1);
    see(13, 8);
    assert.deepEqual(said[1], { type: 'mode', mode: 'autonomous', seq: 2, frame: 13, nonce: 8 });
    start.follow({ ...STOPPED, mode: 'autonomous' });
    see(14, 9);
    assert.equal(said.length, 2, 'the robot is already in the mode');
  });
}

test('an old tap starts nothing, and the page says so', () => {
  start.ask('train');
  start.refuse({ code: 'stale', seq: 1 });
  see(13, 8, YOUNG_MS + 1);
  assert.equal(said.length, 1);
  assert.equal(failures, 1);
  see(14, 9);
  assert.deepEqual([said.length, failures], [1, 1]);
});

test('a start without an answer is not repeated', () => {
  start.ask('train');
  for (let frame = 13; frame < 60; frame += 1) see(frame, frame);
  assert.deepEqual([said.length, failures], [1, 0]);
});

test('a start is not repeated after another error, or if the error belongs to another message', () => {
  start.ask('train');
  start.refuse({ code: 'stale' });
  start.refuse({ code: 'stale', seq: 99 });
  see(13, 8);
  start.refuse({ code: 'not_pilot', seq: 1 });
  see(14, 9);
  assert.equal(said.length, 1);
});

const BETWEEN = {
  'a stop': () => start.ask('stopped'),
  'an emergency stop': () => start.forget(),
  'an emergency stop of somebody else': () => start.follow({ ...STOPPED, emergency: true }),
  'another pilot': () => start.follow({ ...STOPPED, you_are_pilot: false }),
};
for (const [what, happens] of Object.entries(BETWEEN)) {
  test(`${what} cancels the start before it`, () => {
    start.ask('train');
    start.refuse({ code: 'stale', seq: 1 });
    happens();
    see(13, 8);
    assert.deepEqual(said.slice(1).map((word) => word.mode).filter((mode) => mode !== 'stopped'), []);
  });
}
