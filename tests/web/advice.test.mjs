import assert from 'node:assert/strict';
import { test } from 'node:test';

import { ageParts, modeToPress, teachingAdvice, urgentAdvice, usedMoves, whatToSay, whoDrives } from '../../web/js/advice.js';
import { setbackOf } from '../../web/js/coaching/readiness.js';
import { initialState } from '../../web/js/store.js';
import { leadOf } from '../../web/js/study/session.js';

const robot = (changes = {}) => ({
  mode: 'train', stop_reason: null, emergency: false, fault: null, asks_pilot: false, link: 'good',
  you_are_pilot: true, pilot: 'c1', lessons: 300, agreement: 0.9, agreement_frames: 100,
  taught: { forward: 180, left: 60, right: 60 }, ...changes,
});
const page = (changes = {}, robotChanges = {}) =>
  ({ ...initialState(), link: 'open', robot: robot(robotChanges), ...changes });
const key = (state) => urgentAdvice(state)?.key ?? null;

const readiness = (changes = {}) => ({
  stage: 'teach', alone_s: 0, alone_needed_s: 30, unknown_share: 0, moves: ['forward', 'left'], missing: [], ...changes,
});
const short = { kind: 'too_short', move: null, instead: null, have: 12.3, need: 40, distance_m: null };
const rare = { kind: 'rare_move', move: 'left', instead: null, have: 1, need: 3, distance_m: null };
const corrected = { kind: 'corrected', move: 'left', instead: 'forward', have: 0, need: 0, distance_m: 0.2 };

test('the advice never asks for a move that the pilot does not use', () => {
  assert.deepEqual(usedMoves({ forward: 200, left: 100, right: 0 }), ['forward', 'left']);
  for (let left = 0; left <= 300; left += 7) {
    for (const slips of [0, 1, 4, 8]) {
      const taught = { forward: 300, left, right: slips, backward: 0 };
      for (const mode of ['train', 'stopped', 'autonomous']) {
        for (const missing of [[short], [rare], [short, rare, corrected], []]) {
          // The robot names only moves in use (tests/robot/coaching/test_readiness.py).
          const { move } = teachingAdvice(robot({ mode, taught, agreement: 0.5 }), readiness({ missing }));
          assert.ok(move === undefined || move === 'left', `${move} of ${JSON.stringify(taught)}`);
        }
      }
    }
  }
});

test('the advice asks for a turn if the pilot has taught only one move', () => {
  for (const stage of ['teach', 'try', 'ready']) {
    assert.equal(teachingAdvice(robot({ taught: { forward: 300, left: 0, right: 2 } }), readiness({ stage })).key, 'advice.turn');
    assert.equal(teachingAdvice(robot({ taught: { forward: 0, left: 300, right: 2 } }), readiness({ stage })).key, 'advice.go_on', 'the robot has seen only a turn');
  }
});

test('no advice asks for teaching while the robot drives by itself', () => {
  for (const stage of ['teach', 'try', 'ready']) {
    for (const missing of [[short, rare], [corrected], []]) {
      for (const alone_s of [0, 0.4, 12, 30, 55]) {
        const { key } = teachingAdvice(robot({ mode: 'autonomous' }), readiness({ stage, missing, alone_s }));
        assert.ok(['advice.watch', 'advice.trial', 'advice.can'].includes(key), key);
      }
    }
  }
});

test('only a trial without a mistake makes the robot ready, not a high agreement', () => {
  for (const agreement of [0.5, 0.9, 1]) {
    for (const stage of ['teach', 'try']) {
      for (const mode of ['stopped', 'train', 'autonomous']) {
        const { key } = teachingAdvice(robot({ agreement, mode }), readiness({ stage, alone_s: 29.9 }));
        assert.ok(!['advice.ready', 'advice.can'].includes(key), key);
      }
    }
    assert.equal(teachingAdvice(robot({ agreement }), readiness({ stage: 'ready', alone_s: 30 })).key, 'advice.ready');
  }
});

test('the advice names one step at a time, from the first visit to the first drive', () => {
  const advice = (changes, told = null) => teachingAdvice(robot(changes), told);
  assert.equal(advice({ mode: 'stopped', lessons: 0, taught: {} }).key, 'advice.start');
  assert.equal(advice({ lessons: 0, taught: {} }).key, 'advice.first');
  assert.equal(advice({}, readiness({ missing: [short] })).key, 'advice.go_on');
  assert.deepEqual(advice({ mode: 'stopped' }, readiness({ missing: [short] })), { key: 'advice.more', left: 28 });
  assert.deepEqual(advice({}, readiness({ missing: [rare] })), { key: 'advice.rare', move: 'left', have: 1, need: 3 });
  assert.equal(advice({}, readiness({ stage: 'try' })).key, 'advice.try');
  assert.equal(advice({ mode: 'autonomous' }, readiness({ stage: 'try' })).key, 'advice.watch');
  assert.deepEqual(advice({ mode: 'autonomous' }, readiness({ stage: 'try', alone_s: 12.5 })), { key: 'advice.trial', left: 20 });
  assert.equal(advice({ mode: 'autonomous' }, readiness({ stage: 'ready' })).key, 'advice.can');
  assert.equal(advice({ mode: 'stopped' }, readiness({ stage: 'ready' })).key, 'advice.ready');
});

test('the page lets the pilot release an emergency stop, and offers other clients only what the robot accepts from them', () => {
  const step = (changes, robot) => urgentAdvice(page(changes, { emergency: true, ...robot })).step;
  assert.equal(step({}, {}), 'release');
  assert.equal(step({}, { you_are_pilot: false, pilot: null }), 'take', 'otherwise nobody could release the stop');
  assert.equal(step({}, { you_are_pilot: false }), 'take');
  assert.equal(step({ wheelWaiting: true }, { you_are_pilot: false }), undefined);
  assert.equal(step({ role: 'viewer' }, { you_are_pilot: false, pilot: null }), undefined);
});

test('the most urgent sentence has priority', () => {
  assert.equal(key(page({ link: 'connecting', robot: null })), 'connecting');
  assert.equal(key(page({ link: 'lost', way: { kind: 'silent' } }, { emergency: true })), 'out_of_reach');
  assert.equal(key(page({ link: 'lost', way: { kind: 'silent' } }, { you_are_pilot: false })), 'searching', 'somebody else may drive the robot');
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

test('a busy computer is not reported as a bad link, and no pilot on the robot’s own computer is told to move closer', () => {
  for (const link of ['good', 'slow', 'capped', 'not_learning', 'too_slow']) {
    for (const mode of ['train', 'autonomous']) {
      const slowed = ['good', 'slow'].includes(link) ? 'capped' : link;
      assert.equal(key(page({}, { mode, link, busy: true })), `busy.${slowed}`);
      assert.equal(key(page({ isLocal: true }, { mode, link })), link === 'good' ? null : `busy.${link}`);
      assert.equal(key(page({}, { mode, link, busy: false })), link === 'good' ? null : `link.${link}`);
    }
  }
  const stopped = { mode: 'stopped', stop_reason: 'link_slow' };
  assert.equal(key(page({}, { ...stopped, busy: true })), 'busy.stopped');
  assert.equal(key(page({ isLocal: true }, stopped)), 'busy.stopped');
  assert.equal(key(page({}, stopped)), 'stop.link_slow');
  assert.equal(key(page({}, { mode: 'stopped', busy: true, link: 'capped' })), null, 'nothing is reported while the robot stands');
});

test('a session asks for its mode, is silent once the robot is in it, and shows its position and the number of phases', () => {
  const session = { step: 'drive', position: 1, of: 2, kind: 'correct', mode: 'autonomous', left_s: 30 };
  const lead = leadOf(session);
  assert.equal(key(page({ lead }, { mode: 'stopped' })), 'session.next_correct');
  assert.equal(key(page({ lead }, { mode: 'autonomous' })), null);
  assert.deepEqual(whatToSay(page({ lead })), { key: 'session.now_correct', left_s: 30, n: 1, of: 2 });
  const between = (step) => leadOf({ ...session, step, kind: null, mode: null });
  assert.equal(key(page({ lead: between('questions') })), 'session.questions');
  assert.equal(key(page({ lead: between('ready') })), null);
});

test('the age of a picture is split into its parts, and the slow part is named', () => {
  const camera = { period_ms: 100, age_ms: 145, limit_ms: 395, speed_scale: 1 };
  const late = (changes, robotChanges = {}) => page({ drawnAgeMs: 200, drawingMs: 15, ...changes }, { camera, ...robotChanges });
  assert.deepEqual(ageParts(late()), { camera: 145, link: 40, phone: 15 });
  assert.deepEqual(ageParts(late({}, { camera: { ...camera, brick_ms: 50 } })), { camera: 95, brick: 50, link: 40, phone: 15 });
  assert.deepEqual(ageParts(late({}, { camera: { ...camera, brick_ms: 500 } })), { camera: 0, brick: 145, link: 40, phone: 15 });
  assert.equal(urgentAdvice(late({}, { camera: { ...camera, age_ms: 300, brick_ms: 200, speed_scale: 0.75 } }))?.key, 'lag.brick');
  assert.equal(urgentAdvice(late({}, { camera: { ...camera, age_ms: 300, brick_ms: 100, speed_scale: 0.75 } }))?.key, 'lag.camera');
  assert.equal(ageParts(late({ drawnAgeMs: null })), null);
  assert.equal(urgentAdvice(late({}, { camera: { ...camera, age_ms: 300, speed_scale: 0.75 } }))?.key, 'lag.camera');
  for (const drawingMs of [280, 320]) assert.deepEqual(urgentAdvice(late({ drawnAgeMs: 500, drawingMs }))?.values, { ms: 300 }, 'similar ages are read out only once');
  assert.equal(urgentAdvice(late({ drawnAgeMs: 500, drawingMs: 320 }))?.key, 'lag.phone');
  assert.equal(urgentAdvice(late({}, { link: 'slow' }))?.key, 'link.slow');
  assert.equal(urgentAdvice(late()), null);
});

test('the page says why a countdown started again, and says nothing while it continues', () => {
  const at = (alone_s, more = {}) => readiness({ stage: 'try', alone_s, ...more });
  for (const kind of ['corrected', 'pushed', 'helpless', 'unknown_view']) {
    assert.equal(setbackOf(at(25), at(0, { missing: [{ ...corrected, kind }] })), kind);
  }
  assert.equal(setbackOf(at(25), at(27, { missing: [corrected] })), null);
  assert.equal(setbackOf(null, at(0, { missing: [corrected] })), null);
  assert.equal(setbackOf(at(29), readiness({ stage: 'ready', alone_s: 30 })), null);
  const told = (mode) => whatToSay(page({ readiness: at(0), setback: 'pushed' }, { mode })).key;
  assert.equal(told('autonomous'), 'setback.pushed');
  assert.notEqual(told('train'), 'setback.pushed');
});

test('the next button is highlighted, unless it is already pressed or something else is urgent', () => {
  const lit = (changes, robotChanges) => modeToPress(page(changes, robotChanges));
  assert.equal(lit({}, { mode: 'stopped', lessons: 0 }), 'train');
  for (const stage of ['try', 'ready']) {
    assert.equal(lit({ readiness: readiness({ stage }) }), 'autonomous');
    assert.equal(lit({ readiness: readiness({ stage }) }, { mode: 'autonomous' }), null);
    assert.equal(lit({ readiness: readiness({ stage }) }, { emergency: true }), null);
    assert.equal(lit({ readiness: readiness({ stage }), link: 'lost' }), null);
  }
  assert.equal(lit({ readiness: readiness() }), null);
});

test('a client that gets the wheel reads that it has the wheel, not that the pilot left', () => {
  const state = page({ localStop: 'wheel' }, { mode: 'stopped', stop_reason: 'pilot_gone' });
  assert.deepEqual(urgentAdvice(state), { key: 'local.wheel', level: 'ask' });
});

test('only pilots with a keyboard read about keys', () => {
  assert.equal(key(page({ hint: 'correct' })), 'hint.correct');
  assert.equal(key(page({ hint: 'correct', hasKeys: true })), 'hint.correct_keys');
});

test('a robot that stands and asks for help does not count as driving', () => {
  const alone = { mode: 'autonomous', driven_by: 'robot', action: 'left' };
  assert.equal(whoDrives(robot(alone)), 'robot');
  assert.equal(whoDrives(robot({ ...alone, asks_pilot: true })), 'robot'); // the robot drives on slowly
  assert.equal(whoDrives(robot({ ...alone, asks_pilot: true, action: 'stop' })), 'asks');
  assert.equal(whoDrives(robot({ mode: 'autonomous', driven_by: 'pilot', asks_pilot: true, action: 'left' })), 'pilot');
  assert.equal(whoDrives(robot({ driven_by: 'nobody' })), 'waiting');
  assert.equal(whoDrives(robot({ driven_by: 'nobody', mode: 'stopped' })), 'nobody');
  assert.equal(whoDrives(robot({ driven_by: 'pilot', you_are_pilot: false, action: 'left' })), 'other');
  assert.equal(whoDrives(robot({ driven_by: 'nobody', you_are_pilot: false })), 'nobody', 'a viewer is not asked to drive');
  assert.equal(whoDrives(null), 'nobody');
});
