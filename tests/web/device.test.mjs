import assert from 'node:assert/strict';
import { test } from 'node:test';

import { Preferences, WakeLock } from '../../web/js/device.js';

test('one lock keeps the screen on, however often it is requested before the browser answers', async () => {
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
  assert.equal(held.size, 0, 'a screen that need not stay on may turn off');
});

test('two tabs of one phone do not undo each other’s settings', () => {
  const kept = new Map();
  const storage = { getItem: (key) => kept.get(key) ?? null, setItem: (key, value) => kept.set(key, value) };
  const [older, newer] = [new Preferences(storage), new Preferences(storage)];
  newer.set('vibrate', false);
  newer.chooseStick('rover', true);
  older.set('hintsShown', ['teach']);
  older.set('tilt', true);
  const { vibrate, tilt, hintsShown, values: { sticks } } = new Preferences(storage);
  assert.deepEqual([vibrate, tilt, hintsShown, sticks], [false, true, ['teach'], ['rover']]);
});

test('if the storage is full, a setting lasts until the page is closed', () => {
  const full = { getItem: () => '{"vibrate":true}', setItem: () => { throw new Error('QuotaExceededError'); } };
  const preferences = new Preferences(full);
  preferences.set('vibrate', false);
  preferences.set('sound', false);
  assert.deepEqual([preferences.vibrate, preferences.sound], [false, false]);
});
