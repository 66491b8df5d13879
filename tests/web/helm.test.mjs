import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { Helm } from '../../web/js/helm.js';

const MOVES = ['forward', 'left', 'right'];
let helm;
let said;

beforeEach(() => {
  said = [];
  let seq = 0;
  const connection = { nextSeq: () => ++seq, send: (text) => said.push(JSON.parse(text)) };
  helm = new Helm(connection, () => ({ frame: 12, nonce: 7, frameAgeMs: 30 }));
  helm.follow({ mode: 'train', you_are_pilot: true }, MOVES);
});

const held = () => said.map((word) => word.held);

test('each change is said at once, with the picture that was looked at', () => {
  helm.press('finger 1', 'forward');
  helm.release('finger 1');
  assert.deepEqual(said, [
    { type: 'drive', held: 'forward', frame: 12, seq: 1, nonce: 7, frame_age_ms: 30 },
    { type: 'drive', held: null, frame: 12, seq: 2, nonce: 7, frame_age_ms: 30 },
  ]);
});

test('one direction at a time: the newest counts, and below it the one still held', () => {
  helm.press('finger 1', 'forward');
  helm.press('finger 2', 'left');
  helm.release('finger 2');
  helm.release('finger 1');
  assert.deepEqual(held(), ['forward', 'left', 'forward', null]);
});

test('a finger that slides changes its direction', () => {
  helm.press('finger 1', 'forward');
  helm.press('finger 1', 'forward');
  helm.press('finger 1', 'right');
  assert.deepEqual(held(), ['forward', 'right']);
});

test('without a chosen mode nothing is held, and the page is told', () => {
  let refused = 0;
  helm.addEventListener('refused', () => (refused += 1));
  helm.follow({ mode: 'stopped', you_are_pilot: true }, MOVES);
  helm.press('finger 1', 'forward');
  assert.equal(helm.held, null);
  assert.equal(refused, 1);
});

test('a stop lets go of everything: it must be pressed anew', () => {
  helm.press('finger 1', 'forward');
  helm.follow({ mode: 'stopped', you_are_pilot: true }, MOVES);
  helm.follow({ mode: 'train', you_are_pilot: true }, MOVES);
  helm.beat();
  assert.equal(said.at(-1).held, null);
});

test('a lost link lets go, and says nothing to the next one before it has the wheel', () => {
  helm.press('finger 1', 'forward');
  helm.lose();
  const before = said.length;
  helm.beat();
  assert.equal(said.length, before);
  assert.equal(helm.held, null);
});

test('who only watches sends no commands', () => {
  helm.follow({ mode: 'train', you_are_pilot: false }, MOVES);
  helm.press('finger 1', 'forward');
  helm.beat();
  assert.deepEqual(said, []);
});

test('a move that the robot was not given is no move', () => {
  helm.press('key ArrowDown', 'backward');
  assert.equal(helm.held, null);
});

test('choosing a mode lets go first', () => {
  helm.press('finger 1', 'forward');
  helm.choose('autonomous');
  assert.deepEqual(said.slice(1).map((w) => w.mode ?? w.held), [null, 'autonomous']);
});

test('a heartbeat is sent when it is due, whoever asks, and lateness is noticed', () => {
  for (let ms = 0; ms <= 1000; ms += 10) helm.beatIfDue(ms);
  assert.ok(said.length >= 10 && said.length <= 12, `${said.length} heartbeats in a second`);
  assert.ok(helm.lateMs < 5);
  for (let ms = 1100; ms <= 4000; ms += 180) helm.beatIfDue(ms);
  assert.ok(helm.lateMs > 15, 'a phone whose timers come late is slow');
});
