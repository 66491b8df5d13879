import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';

const SOURCE = readFileSync(new URL('../../web/sw.js', import.meta.url), 'utf8');
const HOME = 'https://robot/room/';

/** Request a file from the service worker, with a storage and a robot; `later` gets its background work. */
function ask(file, storage, robot, later = []) {
  const listeners = {};
  const self = { addEventListener: (type, act) => (listeners[type] = act) };
  new Function('self', 'caches', 'fetch', 'location', SOURCE)(self, storage, robot, new URL(`${HOME}sw.js`));
  const request = { url: HOME + file, method: 'GET', mode: file ? 'no-cors' : 'navigate' };
  let answer;
  listeners.fetch({ request, respondWith: (given) => (answer = given), waitUntil: (act) => later.push(act) });
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
  test(`the page comes from the robot if it is there, although the phone's storage ${what}`, async () => {
    for (const file of FILES) assert.equal(await (await ask(file, storage, robot)).text(), `the robot's ${HOME}${file}`);
  });
}

test('a stored page opens without the robot', async () => {
  const storage = { open: async () => ({ ...holding(new Response('kept')), put: fails }) };
  assert.equal(await (await ask('', storage, fails)).text(), 'kept');
});

/** A phone that has stored the old page, and a robot with a newer one. */
function updated(partComes) {
  const page = (etag) => new Response(`page ${etag}`, { headers: { etag } });
  const files = new Map([[HOME, page('old')]]);
  const kept = {
    match: async ({ url }) => files.get(url)?.clone(), put: async ({ url }, answer) => void files.set(url, answer), keys: async () => [],
    delete: async () => {}, addAll: async (names) => {
      if (!partComes()) throw new TypeError('a part did not come'); // and then no part is stored
      for (const name of names) files.set(new URL(name, HOME).href, name === './' ? page('new') : new Response(name));
    },
  };
  const robot = async (asked) => (asked === 'shell.json' ? Response.json(['./', 'js/0123456789-new.js']) : page('new'));
  return { files, robot, storage: { open: async () => kept } };
}

test('a newer page is stored with all its parts, or not at all', async () => {
  let comes = false;
  const { files, robot, storage } = updated(() => comes);
  for (const age of ['old', 'new']) {
    const later = [];
    assert.equal(await (await ask('', storage, robot, later)).text(), 'page new');
    await Promise.all(later);
    assert.equal(await files.get(HOME).clone().text(), `page ${age}`);
    comes = true; // the next visit tries again
  }
  assert.ok(files.has(`${HOME}js/0123456789-new.js`));
});

test('a newer page that arrives too late for a visit is stored for the next', async (t) => {
  t.mock.timers.enable({ apis: ['setTimeout'] });
  const { files, robot, storage } = updated(() => true);
  let answer;
  const late = new Promise((come) => (answer = come));
  const later = [];
  const shown = ask('', storage, async (asked) => (asked === 'shell.json' ? robot(asked) : late), later);
  for (let i = 0; i < 30; i += 1) {
    await new Promise(setImmediate);
    t.mock.timers.tick(100);
  }
  assert.equal(await (await shown).text(), 'page old');
  assert.equal(later.length, 1, 'the browser must not end the worker before the robot has answered');
  answer(await robot(''));
  await later[0];
  await Promise.all(later);
  assert.equal(await files.get(HOME).clone().text(), 'page new');
});
