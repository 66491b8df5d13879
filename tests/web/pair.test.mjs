import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';

test('an open pairing page redeems a new token from its address, and its sentences do not change', async () => {
  const html = readFileSync(new URL('../../web/pair/index.html', import.meta.url), 'utf8');
  const written = [...html.matchAll(/data-say="(\w+)">([^<]+)</g)].map(([, key, words]) => ({ key, words }));
  const shown = written.map(({ key }) => ({ getAttribute: () => key, textContent: '' }));
  /** @type {Record<string, () => void>} */
  const heard = {};
  /** @type {string[]} */
  const sent = [];
  const element = { textContent: '', addEventListener() {}, focus() {} };
  Object.assign(globalThis, {
    document: { documentElement: {}, querySelector: () => element, querySelectorAll: () => shown },
    location: { hash: '', pathname: '/pair' },
    history: { replaceState: () => (globalThis.location.hash = '') },
    addEventListener: (name, act) => (heard[name] = act),
    fetch: async (path, { body }) => {
      sent.push(JSON.parse(body).token);
      return { ok: false, status: 403 };
    },
  });
  if (!('navigator' in globalThis)) globalThis.navigator = { languages: ['en'] };
  await import('../../web/pair/pair.js');
  assert.deepEqual(sent, [], 'there was no token after the #');
  assert.deepEqual(shown.map(({ textContent }) => textContent), written.map(({ words }) => words));
  for (const token of ['AAAA', 'BBBB']) {
    globalThis.location.hash = `#${token}`;
    heard.hashchange();
  }
  assert.deepEqual(sent, ['AAAA', 'BBBB']);
  assert.equal(globalThis.location.hash, '', 'the token is removed from the history');
});
