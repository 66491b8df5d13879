import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';

const SOURCE = readFileSync(new URL('../../web/sw.js', import.meta.url), 'utf8');
const HOME = 'https://robot/room/';

/** Ask the service worker for a file, with a storage and a robot. */
function ask(file, storage, robot) {
  const listeners = {};
  const self = { addEventListener: (type, act) => (listeners[type] = act) };
  new Function('self', 'caches', 'fetch', 'location', SOURCE)(self, storage, robot, new URL(`${HOME}sw.js`));
  const request = { url: HOME + file, method: 'GET', mode: file ? 'no-cors' : 'navigate' };
  let answer;
  listeners.fetch({ request, respondWith: (given) => (answer = given), waitUntil() {} });
  return answer;
}

const fails = async () => { throw new Error('QuotaExceededError'); };
const holding = (kept) => ({ match: async () => kept, put: async () => {}, keys: async () => [], addAll: fails });
const STORAGES = {
  'holds nothing yet': { open: async () => holding(undefined) },
  'is full': { open: async () => ({ ...holding(undefined), put: fails }) },
  'cannot be read': { open: async () => ({ ...holding(undefined), match: fails }) },
  'cannot be opened': { open: fails },
};
const FILES = ['', 'js/0123456789-main.js', 'icons/plate.svg'];
const robot = async ({ url }) => new Response(`the robot's ${url}`);

for (const [what, storage] of Object.entries(STORAGES)) {
  test(`the page comes from a robot that is there, though the phone's storage ${what}`, async () => {
    for (const file of FILES) assert.equal(await (await ask(file, storage, robot)).text(), `the robot's ${HOME}${file}`);
  });
}

test('a page that was kept opens without the robot', async () => {
  const storage = { open: async () => ({ ...holding(new Response('kept')), put: fails }) };
  assert.equal(await (await ask('', storage, fails)).text(), 'kept');
});
