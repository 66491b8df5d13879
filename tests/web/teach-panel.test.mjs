import assert from 'node:assert/strict';
import { test } from 'node:test';

import { initialState } from '../../web/js/store.js';
import { leadOf } from '../../web/js/study/session.js';

Object.assign(globalThis, { HTMLElement: class {}, customElements: { define() {} } });
const { TeachPanel } = await import('../../web/js/components/teach-panel.js');

test('a screen reader reads advice aloud, but not each second of a clock within it', () => {
  const attributes = { };
  const advice = { textContent: '', getAttribute: (name) => attributes[name] ?? null, setAttribute: (name, value) => (attributes[name] = value) };
  const say = () => ({ textContent: '' });
  const panel = Object.assign(new TeachPanel(), { advice, agreement: say(), lessons: say(), renderNotice: () => false, celebrate() {} });
  const robot = { mode: 'train', lessons: 0, agreement: null, agreement_frames: 0, taught: {} };
  const heard = [];
  for (const session of [null, { mode: 'train', kind: 'teach', left_s: 89, position: 1, of: 3 }, null]) {
    panel.render({ ...initialState(), robot, lead: leadOf(session) });
    heard.push(attributes['aria-live']);
  }
  assert.deepEqual(heard, ['polite', 'off', 'polite']);
});

test('a robot that becomes ready is celebrated once; a notice only hides the message, and nothing sounds if sound is off', (t) => {
  t.mock.timers.enable({ apis: ['setTimeout'] });
  let [notes, isNoticed] = [0, false];
  const gain = { setValueAtTime() {}, exponentialRampToValueAtTime() {} };
  const joined = () => ({ connect: joined, frequency: {}, gain, start() {}, stop() {} });
  globalThis.AudioContext = class { currentTime = 0; createOscillator = () => { notes += 1; return joined(); }; createGain = joined; };
  const classes = new Set();
  const classList = { add: (name) => classes.add(name), remove: (name) => classes.delete(name), toggle: (name, isOn) => classes[isOn ? 'add' : 'delete'](name) };
  const preferences = { sound: true };
  const advice = { textContent: '', getAttribute: () => 'polite' };
  const panel = Object.assign(new TeachPanel(), { advice, agreement: {}, lessons: {}, classList, page: { preferences }, renderNotice: () => isNoticed });
  const robot = { mode: 'autonomous', you_are_pilot: true, lessons: 300, agreement: null, agreement_frames: 0, taught: { forward: 200, left: 90, right: 90 } };
  const tell = (stage) => {
    panel.render({ ...initialState(), link: 'open', robot, readiness: { stage, alone_s: 0, alone_needed_s: 45, unknown_share: 0, missing: [] } });
    return [...classes].sort().join(' ');
  };
  assert.equal(tell('try'), '');
  assert.equal(tell('ready'), 'joy ready');
  isNoticed = true;
  assert.equal(tell('ready'), 'joy');
  isNoticed = false;
  assert.equal(tell('ready'), 'joy ready');
  assert.equal(notes, 3, 'the notes are played once');
  t.mock.timers.tick(2000);
  assert.equal(tell('ready'), 'ready', 'the celebration is over');
  preferences.sound = false;
  tell('try');
  assert.equal(tell('ready'), 'joy ready');
  assert.equal(notes, 3, 'muted');
});
