import assert from 'node:assert/strict';
import { test } from 'node:test';

import { WakeLock } from '../../web/js/device.js';

test('the screen is kept on by one lock, however often it is wanted before the browser answers', async () => {
  const held = new Set();
  const answers = [];
  const makeLock = () => {
    const lock = { addEventListener: (_, act) => (lock.released = act), release: async () => { held.delete(lock); lock.released(); } };
    held.add(lock);
    return lock;
  };
  const request = () => new Promise((answer) => answers.push(() => answer(makeLock())));
  Object.defineProperty(globalThis, 'navigator', { value: { wakeLock: { request } }, configurable: true });
  globalThis.document = { visibilityState: 'visible' };
  const wakeLock = new WakeLock();
  const wants = Array.from({ length: 5 }, () => wakeLock.want(true));
  answers.forEach((answer) => answer());
  await Promise.all(wants);
  assert.equal(held.size, 1);
  await wakeLock.want(false);
  assert.equal(held.size, 0, 'a screen that need not be on goes off');
});
