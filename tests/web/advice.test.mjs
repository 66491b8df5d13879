import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';

import { READY_AGREEMENT, ageParts, isReady, starvedMove, teachingAdvice, urgentAdvice, usedMoves } from '../../web/js/advice.js';
import { initialState } from '../../web/js/store.js';

const robot = (changes = {}) => ({
  mode: 'train', stop_reason: null, emergency: false, fault: null, asks_pilot: false, link: 'good',
  you_are_pilot: true, pilot: 'c1', lessons: 300, agreement: 0.9, agreement_frames: 100,
  taught: { forward: 180, left: 60, right: 60 }, ...changes,
});
const page = (changes = {}, robotChanges = {}) =>
  ({ ...initialState(), link: 'open', robot: robot(robotChanges), ...changes });
const key = (state) => urgentAdvice(state)?.key ?? null;

test('a move is starved below a tenth, once there is something to go by', () => {
  assert.equal(starvedMove({ forward: 40, left: 0 }), null);
  assert.deepEqual(starvedMove({ forward: 95, left: 5 }), { move: 'left', share: 0.05 });
  assert.equal(starvedMove({ forward: 60, left: 20, right: 20 }), null);
});

test('ready is: much taught, much agreed, nothing starved', () => {
  assert.equal(isReady(robot()), true);
  assert.equal(isReady(robot({ lessons: 100 })), false);
  assert.equal(isReady(robot({ agreement: 0.8 })), false);
  assert.equal(isReady(robot({ taught: { forward: 290, left: 10 } })), false);
});

test('the box needs two moves: what this pilot does not use is never asked for', () => {
  assert.equal(isReady(robot({ taught: { forward: 200, left: 100, right: 0 } })), true);
  for (let left = 0; left <= 300; left += 7) {
    for (const slips of [0, 1, 4, 8]) {
      const taught = { forward: 300, left, right: slips, backward: 0 };
      for (const mode of ['train', 'stopped', 'autonomous']) {
        const { move } = teachingAdvice(robot({ mode, taught, agreement: 0.5 }));
        assert.ok(move === undefined || usedMoves(taught).includes(move), `${move} of ${JSON.stringify(taught)}`);
        assert.notEqual(move, 'right');
        assert.notEqual(move, 'backward');
      }
    }
  }
});

test('one move alone is no driving: a turn is asked for', () => {
  assert.equal(teachingAdvice(robot({ taught: { forward: 300, left: 0, right: 2 } })).key, 'advice.turn');
  assert.equal(isReady(robot({ taught: { forward: 300, left: 0 } })), false);
});

test('a robot that drives itself is never urged to be taught', () => {
  assert.equal(teachingAdvice(robot({ mode: 'autonomous', taught: { forward: 290, left: 10 } })).key, 'advice.watch');
});

test('the documents tell the same number', () => {
  const share = `${Math.round(100 * READY_AGREEMENT)} %`;
  for (const file of ['tutorial.md', 'howto/page.md']) {
    const shares = [...readFileSync(new URL(`../../docs/${file}`, import.meta.url), 'utf8').matchAll(/\d+ %/g)].map(String);
    assert.ok(shares.includes(share), file);
    assert.deepEqual([...new Set(shares)], [share], file);
  }
});

test('one step at a time, from the first visit to the first drive', () => {
  const advice = (changes) => teachingAdvice(robot(changes)).key;
  assert.equal(advice({ mode: 'stopped', lessons: 0, taught: {} }), 'advice.start');
  assert.equal(advice({ lessons: 0, taught: {} }), 'advice.first');
  assert.equal(advice({ taught: { forward: 290, left: 10 } }), 'advice.starved');
  assert.equal(advice({ agreement: 0.5 }), 'advice.go_on');
  assert.equal(advice({}), 'advice.ready');
  assert.equal(advice({ mode: 'autonomous' }), 'advice.watch');
});

test('the most urgent is said first', () => {
  assert.equal(key(page({ link: 'connecting', robot: null })), 'connecting');
  assert.equal(key(page({ link: 'lost' }, { emergency: true })), 'out_of_reach');
  assert.equal(key(page({}, { emergency: true, you_are_pilot: false })), 'emergency');
  assert.equal(key(page({}, { you_are_pilot: false })), 'wheel_taken');
  assert.equal(key(page({}, { you_are_pilot: false, pilot: null })), 'wheel_free');
  assert.equal(key(page({ role: 'viewer' }, { you_are_pilot: false })), 'viewer');
  assert.equal(key(page({ wheelWaiting: true }, { you_are_pilot: false })), 'wheel_waiting');
  assert.equal(key(page({ wheelAsked: true })), 'wheel_asked');
  assert.equal(key(page({ localStop: 'hidden' }, { mode: 'stopped' })), 'local.hidden');
  assert.equal(key(page({}, { mode: 'stopped', stop_reason: 'pilot_silent' })), 'stop.pilot_silent');
  assert.equal(key(page({}, { mode: 'stopped', stop_reason: 'pilot_asked' })), null);
  assert.equal(key(page({}, { mode: 'autonomous', asks_pilot: true })), 'asks');
  const helpless = { mode: 'autonomous', asks_pilot: true, stop_reason: 'needs_help' };
  assert.equal(key(page({}, helpless)), 'asks_help');
  assert.equal(key(page({}, { link: 'capped' })), 'link.capped');
  assert.equal(key(page({ hint: 'bars', notice: 'choose_first' })), 'choose_first');
  assert.equal(key(page({ notice: 'start_stale' }, { mode: 'stopped', stop_reason: 'frame_stale' })), 'start_stale');
  assert.equal(key(page({ hint: 'bars' })), 'hint.bars');
  assert.equal(key(page()), null);
});

test('a lesson asks for its mode, and falls silent in it', () => {
  const lesson = { trial: 1, phase: 'correct', mode: 'autonomous' };
  assert.equal(key(page({ lesson }, { mode: 'stopped' })), 'lesson.next_correct');
  assert.equal(key(page({ lesson }, { mode: 'autonomous' })), null);
  assert.equal(key(page({ lesson: { ...lesson, phase: 'question', mode: null } })), 'lesson.over');
});

test('the age of a picture is told by its parts, and what is slow by its name', () => {
  const camera = { period_ms: 100, age_ms: 145, limit_ms: 395, speed_scale: 1 };
  const late = (changes, robotChanges = {}) => page({ drawnAgeMs: 200, drawingMs: 15, ...changes }, { camera, ...robotChanges });
  assert.deepEqual(ageParts(late()), { camera: 145, link: 40, phone: 15 });
  assert.equal(ageParts(late({ drawnAgeMs: null })), null);
  assert.equal(urgentAdvice(late({}, { camera: { ...camera, age_ms: 300, speed_scale: 0.75 } }))?.key, 'lag.camera');
  assert.equal(urgentAdvice(late({ drawnAgeMs: 500, drawingMs: 320 }))?.key, 'lag.phone');
  assert.equal(urgentAdvice(late({}, { link: 'slow' }))?.key, 'link.slow');
  assert.equal(urgentAdvice(late()), null);
});
