import assert from 'node:assert/strict';
import { beforeEach, mock, test } from 'node:test';

import { Helm } from '../../web/js/helm.js';
import { listenToGamepads } from '../../web/js/inputs/gamepad.js';
import { declare } from '../../web/js/moves.js';

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

test('each change is sent immediately, with the picture that the pilot sees', () => {
  helm.press('finger 1', 'forward');
  helm.release('finger 1');
  assert.deepEqual(said, [
    { type: 'drive', held: 'forward', frame: 12, seq: 1, nonce: 7, frame_age_ms: 30 },
    { type: 'drive', held: null, frame: 12, seq: 2, nonce: 7, frame_age_ms: 30 },
  ]);
});

test('the newest direction counts; after its release, the one that is still held', () => {
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

test('without a mode nothing is held, and the page gets an event', () => {
  let refused = 0;
  helm.addEventListener('refused', () => (refused += 1));
  helm.follow({ mode: 'stopped', you_are_pilot: true }, MOVES);
  helm.press('finger 1', 'forward');
  assert.equal(helm.held, null);
  assert.equal(refused, 1);
});

test('a stop releases everything, so each control must be pressed again', () => {
  helm.press('finger 1', 'forward');
  helm.follow({ mode: 'stopped', you_are_pilot: true }, MOVES);
  helm.follow({ mode: 'train', you_are_pilot: true }, MOVES);
  helm.beat();
  assert.equal(said.at(-1).held, null);
});

test('a lost link releases everything, and nothing is sent on the next link before the page has the wheel', () => {
  helm.press('finger 1', 'forward');
  helm.lose();
  const before = said.length;
  helm.beat();
  assert.equal(said.length, before);
  assert.equal(helm.held, null);
});

test('a viewer sends no commands', () => {
  helm.follow({ mode: 'train', you_are_pilot: false }, MOVES);
  helm.press('finger 1', 'forward');
  helm.beat();
  assert.deepEqual(said, []);
});

test('a move that the robot does not have is ignored', () => {
  helm.press('key ArrowDown', 'backward');
  assert.equal(helm.held, null);
});

test('choosing a mode first releases the held move', () => {
  helm.press('finger 1', 'forward');
  helm.choose('autonomous');
  assert.deepEqual(said.slice(1).map((w) => w.mode ?? w.held), [null, 'autonomous']);
});

test('heartbeats are sent when they are due, however often the helm is asked, and lateness is measured', () => {
  for (let ms = 0; ms <= 1000; ms += 10) helm.beatIfDue(ms);
  assert.ok(said.length >= 10 && said.length <= 12, `${said.length} heartbeats in a second`);
  assert.ok(helm.lateMs < 5);
  for (let ms = 1100; ms <= 4000; ms += 180) helm.beatIfDue(ms);
  assert.ok(helm.lateMs > 15, 'late timers show that the phone is slow');
});

const points = () => said.map(({ held: move, steering, throttle }) => (steering === undefined ? move : [move, steering, throttle]));
const proportional = () => declare([['forward', 0], ['left', -1], ['right', 1]].map(([name, steering]) => ({ name, label: {}, icon: '', does: '', steering, throttle: 0.5 })));

test('a stick is grasped, steered and released; at rest it sends null, but stays grasped', () => {
  proportional();
  let nowMs = 0;
  helm.beatMs = -1000;
  mock.method(performance, 'now', () => (nowMs += 100));
  helm.grasp('stick');
  helm.steer('stick', { steering: -0.3, throttle: 0.4 });
  helm.steer('stick', { steering: 0.1, throttle: 0.4 });
  helm.steer('stick', null);
  helm.steer('stick', { steering: 0.9, throttle: 0.4 });
  helm.release('stick');
  mock.restoreAll();
  assert.deepEqual(points(), [['left', -0.3, 0.4], ['forward', 0.1, 0.4], null, ['right', 0.9, 0.4], null]);
});

test('a stick that turns fast sends twenty messages a second, and its release is sent immediately', () => {
  proportional();
  let nowMs = 1000;
  mock.method(performance, 'now', () => nowMs);
  helm.grasp('stick');
  for (; nowMs < 2000; nowMs += 4) {
    helm.steer('stick', { steering: Math.sin(nowMs / 100), throttle: 0.5 });
    if (nowMs % 50 === 0) helm.beatIfDue(nowMs);
  }
  const told = said.length;
  helm.release('stick');
  mock.restoreAll();
  assert.ok(told >= 15 && told <= 30, `${told} messages in a second`);
  assert.equal(said.length, told + 1);
  assert.equal(said.at(-1).held, null);
  assert.equal(said.at(-1).steering, undefined);
});

test('a released stick must be grasped again, whatever the thumb does', () => {
  proportional();
  helm.grasp('stick');
  helm.steer('stick', { steering: 0, throttle: 0.5 });
  helm.releaseAll();
  const before = said.length;
  helm.steer('stick', { steering: 0.5, throttle: 0.5 });
  assert.equal(helm.held, null);
  assert.equal(said.length, before);
  helm.follow({ mode: 'stopped', you_are_pilot: true }, MOVES);
  helm.grasp('stick');
  helm.steer('stick', { steering: 0.5, throttle: 0.5 });
  assert.equal(helm.held, null, 'the stick cannot be grasped while the robot is stopped');
});

test('while the thumb rests, an older finger counts', () => {
  proportional();
  helm.press('finger 1', 'forward');
  helm.grasp('stick');
  assert.equal(helm.held, 'forward');
  helm.steer('stick', { steering: -1, throttle: 0.5 });
  assert.equal(helm.held, 'left');
  helm.steer('stick', null);
  assert.equal(helm.held, 'forward');
});

test('a gamepad works like a stick; after a stop, it must return to its middle first', () => {
  proportional();
  const pad = { index: 0, connected: true, axes: [0, 0], buttons: Array.from({ length: 17 }, () => ({ pressed: false, value: 0 })) };
  const frames = [];
  let pads = [pad];
  Object.defineProperty(globalThis, 'navigator', { value: { getGamepads: () => pads }, configurable: true });
  const listeners = {};
  Object.assign(globalThis, { addEventListener: (type, act) => (listeners[type] = act), requestAnimationFrame: (act) => frames.push(act) });
  helm.takesPoints = true;
  listenToGamepads(helm, { stop: () => helm.releaseAll(), isDriving: () => true });
  listeners.gamepadconnected();
  const look = (x, y) => {
    pad.axes = [x, y];
    frames.pop()();
  };
  look(0, -1);
  assert.deepEqual(helm.newest, { move: 'forward', point: { steering: 0, throttle: 0.5 } });
  pad.buttons[1].pressed = true;
  look(0, -1);
  pad.buttons[1].pressed = false;
  look(0.3, -1);
  assert.equal(helm.held, null, 'the stop released the gamepad');
  look(0, 0);
  look(1, 0);
  assert.equal(helm.held, 'right');
  pads = [];
  frames.pop()();
  assert.equal(helm.held, null, 'a disconnected gamepad drives nothing');
});
