import assert from 'node:assert/strict';
import { test } from 'node:test';

import { initialState } from '../../web/js/store.js';
import { leadOf } from '../../web/js/study/session.js';

Object.assign(globalThis, { HTMLElement: class {}, customElements: { define() {} } });
const { TeachPanel } = await import('../../web/js/components/teach-panel.js');

test('advice is read out; a clock that goes on in it is not, each second', () => {
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
