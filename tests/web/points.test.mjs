import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';

import { readStick } from '../../web/js/inputs/gamepad.js';
import { KeyRamp } from '../../web/js/inputs/keyboard.js';
import { readTiltStick } from '../../web/js/inputs/tilt.js';
import { declare } from '../../web/js/moves.js';
import { REST, fromStick, moveOf, reachOf } from '../../web/js/points.js';

const bodies = JSON.parse(readFileSync(new URL('../vectors/points.json', import.meta.url), 'utf8'));
const learn = (moves) => declare(moves.map((move) => ({ label: {}, icon: '', does: '', ...move })));
const reach = { ahead: 0.5, back: 0.5 };

for (const [body, { moves, points }] of Object.entries(bodies)) {
  test(`a point counts as the same move as on the robot: ${body}`, () => {
    learn(moves);
    const names = moves.map(({ name }) => name);
    for (const [steering, throttle, move] of points) {
      assert.equal(moveOf({ steering, throttle }, names), move, `${steering} ${throttle}`);
    }
  });
}

test('a stick is symmetric, stays within the robot’s limits, and rests in its middle', () => {
  for (let i = -20; i <= 20; i += 1) {
    for (let j = -20; j <= 20; j += 1) {
      const [x, y] = [i / 15, j / 15];
      const point = fromStick(x, y, reach);
      assert.equal(point === null, Math.hypot(x, y) < REST);
      if (!point) continue;
      assert.ok(Math.abs(point.steering) <= 1 && Math.abs(point.throttle) <= 0.5);
      assert.equal(fromStick(-x, y, reach).steering + point.steering, 0);
      assert.ok(point.steering * x >= 0, 'the robot steers to the pushed side');
      assert.ok(y <= 0 || point.throttle >= 0, 'a push ahead never drives backward');
    }
  }
  assert.deepEqual(fromStick(0, 1, reach), { steering: 0, throttle: 0.5 });
  assert.deepEqual(fromStick(1, 0, reach), { steering: 1, throttle: 0.5 });
  assert.deepEqual(fromStick(0, -1, reach), { steering: 0, throttle: -0.5 });
});

test('without a reverse, a stick that is pulled back counts as resting', () => {
  assert.equal(fromStick(0.1, -1, { ahead: 0.5, back: 0 }), null);
  assert.equal(fromStick(1, -0.1, { ahead: 0.5, back: 0 }).throttle, 0.5, 'a thumb at the side may slip a little');
});

test('proportional steering is not faster than the moves', () => {
  learn(bodies.car.moves);
  assert.deepEqual(reachOf(bodies.car.moves.map(({ name }) => name)), { ahead: 1, back: 0.4 });
  assert.deepEqual(reachOf(['hard_left', 'ahead']), { ahead: 0.5, back: 0 });
});

test('while a trigger is pulled, it is the throttle, and the stick only steers', () => {
  const pad = (x, y, ahead = 0, back = 0) =>
    ({ axes: [x, y], buttons: Array.from({ length: 17 }, (_, i) => ({ pressed: false, value: { 7: ahead, 6: back }[i] ?? 0 })) });
  assert.equal(readStick(pad(0.1, 0.05), reach), null);
  assert.deepEqual(readStick(pad(0, -1), reach), { steering: 0, throttle: 0.5 });
  assert.deepEqual(readStick(pad(-1, 0, 1), reach), { steering: -1, throttle: 0.5 });
  assert.equal(readStick(pad(0, 0, 0, 1), reach).throttle, -0.5);
  assert.equal(readStick(pad(0, 0, 0, 1), { ahead: 0.5, back: 0 }), null);
  const half = readStick(pad(0.5, 0, 0.5), reach);
  assert.ok(half.steering > 0.3 && half.steering < 0.5 && half.throttle > 0.2 && half.throttle < 0.25);
});

test('tilting a phone works like pushing a stick, however the phone is held', () => {
  const zero = { beta: 40, gamma: 2 };
  const lean = (beta, gamma, angle) => readTiltStick({ beta: 40 + beta, gamma: 2 + gamma }, zero, angle, reach);
  assert.equal(lean(2, 2, 0), null);
  assert.deepEqual(lean(-30, 0, 0), { steering: 0, throttle: 0.5 });
  assert.deepEqual(lean(-30, 0, 90), { steering: -1, throttle: 0.5 });
  assert.ok(lean(-20, 6, 0).steering > 0 && lean(-20, 6, 0).steering < 0.3);
});

test('keys steer further the longer they are held, and steer back when they are released', (context) => {
  context.mock.timers.enable({ apis: ['setInterval'] });
  const said = [];
  const holds = new Map();
  const helm = {
    holds, reach, grasp: (source) => holds.set(source, null), steer: (_, point) => said.push(point),
    release: (source) => holds.delete(source) && said.push(null),
  };
  const ramp = new KeyRamp(helm);
  ramp.press('ArrowUp', 'forward');
  assert.deepEqual(said, [{ steering: 0, throttle: 0.5 }], 'the throttle acts at once');
  ramp.press('ArrowLeft', 'left');
  context.mock.timers.tick(200);
  const soon = said.at(-1).steering;
  context.mock.timers.tick(2000);
  assert.ok(soon < -0.2 && soon > -0.8, `${soon}`);
  assert.equal(said.at(-1).steering, -1);
  ramp.release('ArrowLeft');
  context.mock.timers.tick(400);
  assert.deepEqual(said.at(-1), { steering: 0, throttle: 0.5 });
  ramp.release('ArrowUp');
  assert.equal(said.at(-1), null);
  const count = said.length;
  context.mock.timers.tick(1000);
  assert.equal(said.length, count, 'without a key nothing is sent');
  ramp.press('ArrowUp', 'forward');
  holds.clear(); // a stop releases everything
  context.mock.timers.tick(1000);
  assert.equal(said.length, count + 1, 'a key that is still down sends nothing more');
  ramp.press('ArrowLeft', 'left');
  assert.deepEqual(said.at(-1), { steering: -0.08, throttle: 0.5 }, 'the old key does not count beside a new one');
});
