import assert from 'node:assert/strict';
import { test } from 'node:test';

import { Helm } from '../../web/js/helm.js';
import { UNRESTED_MS, listenToGamepads, padName } from '../../web/js/inputs/gamepad.js';
import { LET_GO_MS } from '../../web/js/inputs/pad-rest.js';
import { padDesk } from '../../web/js/inputs/pad-desk.js';
import { learn } from '../../web/js/i18n.js';
import { declare } from '../../web/js/moves.js';
import { wordsOf } from './words.mjs';

const MOVES = ['forward', 'left', 'right', 'backward'];
const FRAME_MS = 16;
/** Number of generated pads. */
const PADS = Number(process.env.DRIVELESSON_PADS ?? (process.env.DRIVELESSON_FULL ? 500 : 100));

/** A page in Teach whose pilot has the wheel; `look` runs the browser's next frame. */
function drivingPage(takesPoints = false) {
  declare(MOVES.map((name, i) => ({ name, label: {}, icon: '', does: '', steering: [0, -1, 1, 0][i], throttle: i === 3 ? -0.5 : 0.5 })));
  const helm = new Helm({ send: () => true, nextSeq: () => 1 }, () => ({ frame: 1 }));
  helm.follow({ mode: 'train', you_are_pilot: true }, MOVES);
  helm.takesPoints = takesPoints;
  const page = { helm, pads: [], said: [], choices: {}, offered: null, asked: null, skip: null, nowMs: 1000 };
  let [next, connected] = [null, null];
  Object.defineProperty(globalThis, 'navigator', { value: { getGamepads: () => page.pads }, configurable: true });
  Object.defineProperty(globalThis, 'performance', { value: { now: () => page.nowMs }, configurable: true });
  Object.assign(globalThis, { addEventListener: (type, act) => (connected = act), requestAnimationFrame: (act) => (next = act) });
  const desk = {
    choiceOf: (id) => page.choices[id] ?? null,
    keep: (id, choice) => (page.choices[id] = choice),
    offer: (name, begin) => (page.offered = begin),
    ask: (name, direction, skip) => Object.assign(page, { asked: direction, skip }),
    tell: (key, name) => page.said.push([key, name]),
  };
  listenToGamepads(helm, { stop: () => page.said.push(['stop']), isDriving: () => true, desk });
  page.look = (frames = 1) => {
    for (let i = 0; i < frames; i += 1) {
      page.nowMs += FRAME_MS;
      const act = next ?? connected;
      next = null;
      act();
    }
    return helm.held;
  };
  return page;
}

const makePad = (about = {}) => ({ index: 0, id: 'Pad (STANDARD GAMEPAD Vendor: 054c Product: 09cc)', connected: true, mapping: 'standard', axes: [0, 0, 0, 0], buttons: Array.from({ length: 17 }, () => ({ pressed: false, value: 0 })), ...about });

/** Random numbers that are the same in each run. @param {number} seed */
function lottery(seed) {
  let at = seed;
  return () => ((at = (Math.imul(at ^ (at >>> 15), 2246822519) + 374761393) >>> 0) / 2 ** 32);
}

for (const [what, axes, mapping] of [['a worn stick', [0.65, 0], 'standard'], ['a clutch at its end', [0, -1], ''], ['a throttle that nobody touches', [-1, 0.1, 1], '']]) {
  test(`${what} that the browser first shows during Teach moves nothing`, () => {
    const page = drivingPage();
    page.look();
    page.pads = [makePad({ axes, mapping })];
    for (let i = 0; i < 60; i += 1) assert.equal(page.look(), null);
  });
}

test('no generated pad drives before a hand has touched it, and each pad that has rested drives', () => {
  let driven = 0;
  for (let n = 1; n <= PADS; n += 1) {
    const draw = lottery(n);
    const page = drivingPage(draw() < 0.5);
    const count = 1 + Math.floor(draw() * 3);
    const all = Array.from({ length: count }, (_, index) => {
      const rest = () => [0, 0, 1, -1, 2 * draw() - 1][Math.floor(draw() * 5)];
      const buttons = Array.from({ length: Math.floor(draw() * 20) }, () => {
        const value = draw() < 0.9 ? 0 : draw();
        return { pressed: value > 0.5, value };
      });
      const pad = makePad({ index, id: `pad ${index}`, mapping: draw() < 0.5 ? '' : 'standard', axes: Array.from({ length: Math.floor(draw() * 9) }, rest), buttons });
      return { pad, comesAt: Math.floor(draw() * 40), goesAt: 40 + Math.floor(draw() * 60) };
    });
    for (let at = 0; at < 80; at += 1) {
      page.pads = all.map(({ pad, comesAt, goesAt }) => (at >= comesAt && at < goesAt ? { ...pad, axes: pad.axes.map((way) => way + (draw() - 0.5) * 0.02) } : null));
      assert.equal(page.look(), null, `pad ${n} at ${at}: ${JSON.stringify(all)}`);
    }
    const known = all.find(({ pad }) => pad.mapping === 'standard' && pad.axes.length > 1 && Math.max(Math.abs(pad.axes[0]), Math.abs(pad.axes[1])) < 0.09 && !pad.buttons.some(({ value }) => value > 0.02))?.pad;
    if (!known) continue;
    page.pads = [{ ...known, index: 7 }];
    page.look();
    page.pads = [{ ...known, index: 7, axes: [0, -1] }];
    assert.equal(page.look(), 'forward', `pad ${n}`);
    driven += 1;
  }
  assert.ok(driven > PADS / 200, `${driven}`);
});

test('a released stick stops the robot while the browser draws no frames', () => {
  const page = drivingPage();
  const pad = makePad();
  page.pads = [pad];
  page.look();
  pad.axes = [0, -1];
  assert.equal(page.look(), 'forward');
  pad.axes = [0, 0];
  page.nowMs += 100; // another window covers the page: its timers run, its frames do not
  page.helm.beatIfDue(page.nowMs);
  assert.equal(page.helm.held, null);
  page.pads = [];
  assert.equal(page.look(), null);
});

test('a press of the cross that only woke the pad does not drive; the next press does', () => {
  const page = drivingPage();
  const pad = makePad();
  page.look();
  pad.buttons[14] = { pressed: true, value: 1 };
  page.pads = [pad];
  assert.equal(page.look(3), null);
  pad.buttons[14] = { pressed: false, value: 0 };
  page.look();
  pad.buttons[14] = { pressed: true, value: 1 };
  assert.equal(page.look(), 'left');
});

test('the page says once that a stick is off its middle from the start', () => {
  const page = drivingPage();
  page.pads = [makePad({ axes: [0.65, 0] })];
  page.look(3 * (UNRESTED_MS / FRAME_MS));
  assert.deepEqual(page.said, [['pad.unrested', 'Pad']]);
});

test('a person shows the page the directions of an unknown pad, which are stored under the pad’s name', () => {
  const page = drivingPage();
  const wheel = makePad({ id: '046d-c24f-Wheel', mapping: '', axes: [0, 0, 0], buttons: [{ pressed: false, value: 0 }] });
  page.pads = [wheel];
  page.look();
  const push = (axis, way, rest) => {
    wheel.axes[axis] = way;
    page.look(5);
    wheel.axes[axis] = rest;
    page.look(40);
  };
  wheel.axes[1] = -1; // the first report of the clutch
  page.look();
  assert.equal(page.helm.held, null);
  wheel.axes[0] = -1;
  page.look();
  page.offered();
  page.look(9);
  assert.equal(page.asked, 'rest', 'the stick is still held');
  wheel.axes[0] = 0;
  page.look(LET_GO_MS / FRAME_MS + 2);
  assert.equal(page.asked, 'left');
  push(0, -1, 0);
  assert.equal(page.asked, 'right');
  push(0, -1, 0);
  assert.equal(page.asked, 'right', 'this direction is already used for left');
  push(0, 1, 0);
  assert.equal(page.asked, 'forward');
  push(2, 1, -1); // a pedal that reported 0 before its first press
  assert.equal(page.asked, 'backward');
  page.skip();
  assert.equal(page.asked, undefined);
  assert.equal(page.look(5), null);
  wheel.axes[2] = 1;
  assert.equal(page.look(), 'forward');
  wheel.axes[2] = -1;
  assert.equal(page.look(), null);
  const again = drivingPage();
  again.choices = page.choices;
  again.pads = [{ ...wheel, axes: [0, -1, 0] }]; // on another day, before the pedal's first report
  assert.equal(again.look(9), null);
  again.pads[0].axes[2] = -1;
  again.look();
  again.pads[0].axes[0] = -1;
  assert.equal(again.look(), 'left');
});

for (const rest of [9 / 7, 23 / 7]) {
  test(`a cross that the browser reports as one axis, with ${rest.toFixed(1)} at rest, drives in all directions`, () => {
    const page = drivingPage();
    const pad = makePad({ id: '0079-0006-Arcade', mapping: '', axes: [0, 0, rest], buttons: [] });
    const way = (/** @type {number} */ number) => (2 * number) / 7 - 1; // clockwise from ahead
    page.pads = [pad];
    page.look();
    const press = (/** @type {number} */ number, frames = 5) => {
      pad.axes[2] = way(number);
      const held = page.look(frames);
      pad.axes[2] = rest;
      page.look(40);
      return held;
    };
    press(6);
    page.offered();
    page.look(LET_GO_MS / FRAME_MS + 2);
    for (const [asked, number] of [['left', 6], ['right', 2], ['forward', 0], ['backward', 4]]) {
      assert.equal(page.asked, asked);
      press(number);
      if (number === 6) press(6); // the same direction again does not count as the next one
    }
    assert.equal(page.asked, undefined);
    for (const [move, number] of [['left', 6], ['right', 2], ['forward', 0], ['backward', 4]]) assert.equal(press(number), move);
    assert.equal(page.look(), null);
    assert.ok(['forward', 'right'].includes(press(1)), 'between two directions, the cross drives one of them');
  });
}

test('the pad that was touched last drives, and the page says so', () => {
  const page = drivingPage();
  const [one, two] = [makePad({ id: 'One' }), makePad({ id: 'Two', index: 1 })];
  page.pads = [one, two];
  page.look();
  one.axes = [0, -1];
  assert.equal(page.look(), 'forward');
  two.axes = [1, 0];
  assert.equal(page.look(), 'right');
  one.axes = [-1, 0];
  assert.equal(page.look(), 'right', 'the first pad must return to rest');
  two.axes = [0, 0];
  assert.equal(page.look(), null);
  one.axes = [0, 0];
  page.look();
  one.axes = [-1, 0];
  assert.equal(page.look(), 'left');
  assert.deepEqual(page.said.map(([key, name]) => `${key} ${name}`), ['pad.used One', 'pad.used Two', 'pad.used One']);
});

test('a pad is shown by its usual name', () => {
  assert.equal(padName('Xbox Wireless Controller (STANDARD GAMEPAD Vendor: 045e Product: 02e0)'), 'Xbox Wireless Controller');
  assert.equal(padName('054c-09cc-Wireless Controller'), 'Wireless Controller');
  assert.equal(padName('(Vendor: 1234 Product: 5678)'), 'Gamepad');
});

test('the page offers to learn an unknown pad, asks for one direction after the other, and stores them', async () => {
  learn(await wordsOf('en'));
  const [kept, said] = [new Map(), []];
  const preferences = { padOf: (id) => kept.get(id) ?? null, choosePad: (id, choice) => kept.set(id, choice) };
  const store = { state: { toast: null } };
  const desk = padDesk(/** @type {any} */ ({ preferences, store, toast: (text, step, ms) => said.push({ text, step, ms }) }));
  const [begin, skip] = [() => {}, () => {}];
  desk.offer('Old Wheel', begin);
  assert.match(said[0].text, /Old Wheel/);
  assert.deepEqual(said[0].step, { label: 'Show its directions', act: begin });
  store.state.toast = said[0];
  desk.offer('Old Wheel', begin);
  assert.equal(said.length, 1, 'the offer is made once, and covers no other message');
  for (const direction of ['rest', 'left', null]) desk.ask('Old Wheel', direction, skip);
  const [rest, push, ready] = said.slice(1);
  assert.match(rest.text, /Let go of Old Wheel/);
  assert.match(push.text, /Old Wheel: push “Left”/);
  assert.deepEqual(push.step, { label: 'No such direction', act: skip });
  assert.deepEqual([rest.ms, push.ms], [Infinity, Infinity], 'the questions stay until they are answered');
  assert.match(ready.text, /Old Wheel is ready/);
  desk.keep('wheel', { left: 1 });
  assert.deepEqual(desk.choiceOf('wheel'), { left: 1 });
});
