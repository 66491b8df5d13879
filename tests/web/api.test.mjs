import assert from 'node:assert/strict';
import { beforeEach, mock, test } from 'node:test';

import { LONG_MS, Refused, STOPPING_MS, ask, askLong, askToStop, inOrder } from '../../web/js/api.js';

beforeEach(() => mock.timers.enable({ apis: ['setTimeout'] }));
test.afterEach(() => {
  mock.timers.reset();
  delete globalThis.fetch;
});

/** Never anything, until it is waited for no more. @param {AbortSignal} signal */
const silence = (signal) => new Promise((_, fail) => signal.addEventListener('abort', () => fail(new DOMException('aborted', 'AbortError'))));
/** How a request ends that has the time `ms` and no more; null if it is still waited for then. */
async function after(ms, asked) {
  const end = Promise.race([asked.then((said) => said, (error) => error), new Promise((soon) => setImmediate(soon, null))]);
  mock.timers.tick(ms);
  return (await end) ?? null;
}

for (const [what, answer] of Object.entries({
  'takes the request and never answers': ({ signal }) => silence(signal),
  'stops in the middle of its answer': async ({ signal }) => ({ ok: true, json: () => silence(signal) }),
})) {
  for (const [method, body, ms, patienceMs] of [['GET', undefined, 15_000], ['POST', {}, LONG_MS], ['PUT', new Blob(['a file']), LONG_MS], ['POST', undefined, STOPPING_MS, STOPPING_MS]]) {
    test(`a robot that ${what} is out of reach: ${method} within ${ms} ms`, async () => {
      globalThis.fetch = (_, about) => answer(about);
      const asked = ask(method, 'api/x', body, patienceMs);
      assert.equal(await after(ms - 1, asked), null, 'a slow one is waited for');
      assert.ok(await after(1, asked) instanceof TypeError, 'as if there was no link');
    });
  }
}

test('a small computer is given a minute to measure itself, or to read a recording', async () => {
  globalThis.fetch = (_, { signal }) => silence(signal);
  assert.equal(await after(60_000, askLong('api/settings')), null);
});

test('an answer that is cut off is none: it would say that there is nothing', async () => {
  for (const why of [new SyntaxError('Unexpected end of JSON input'), new TypeError('network error')]) {
    globalThis.fetch = async () => ({ ok: true, json: () => Promise.reject(why) });
    await assert.rejects(ask('GET', 'api/models'), TypeError);
  }
});

test('what the robot refuses comes with its sentence, or with what there is', async () => {
  for (const [json, sentence] of [[async () => ({ detail: 'It drives.' }), 'It drives.'], [() => Promise.reject(new SyntaxError('<')), '502 Bad Gateway'], [async () => ({ detail: [1] }), '502 Bad Gateway']]) {
    globalThis.fetch = async () => ({ ok: false, status: 502, statusText: 'Bad Gateway', json });
    await assert.rejects(ask('GET', 'api/models'), (error) => error instanceof Refused && error.status === 502 && error.message === sentence);
  }
});

test('a stop is asked for, one request at a time, until the robot hears it, refuses it, or it is owed no more', async () => {
  const silent = ({ signal }) => silence(signal);
  const away = async () => { throw new TypeError('away'); };
  const says = (status) => async () => ({ ok: status < 300, status, json: async () => ({ emergency: true, stop_number: 7 }) });
  /** How it ends at a robot that answers one after the other of `answers`, while `owed` requests are owed; and how many were sent. */
  const end = async (answers, owed = Infinity) => {
    let [sent, open, most] = [0, 0, 0];
    globalThis.fetch = async (path, about) => {
      assert.deepEqual([path, about.method], ['api/stop', 'POST']);
      most = Math.max(most, (open += 1));
      return answers[sent++ % answers.length](about).finally(() => (open -= 1));
    };
    let said;
    askToStop(() => sent < owed).then((number) => (said = number));
    for (let ms = 0; ms < 60_000 && said === undefined; ms += 50) {
      await new Promise(setImmediate);
      mock.timers.tick(50);
    }
    assert.equal(most, 1);
    return [said, sent];
  };
  assert.deepEqual(await end([says(200)]), [7, 1]);
  assert.deepEqual(await end([away, silent, says(502), says(503), says(200)]), [7, 5]);
  assert.deepEqual(await end([away, says(403), says(200)]), [null, 2], 'a page that is not paired');
  assert.deepEqual(await end([away, silent], 3), [null, 3]);
  const [earlier, later] = [askToStop(() => true), end([away, silent, says(200)])];
  assert.deepEqual(await later, [7, 3]);
  assert.equal(await earlier, null, 'it was asked for anew');
});

test('an answer that comes after the answer to a newer question is dropped, and a question that fails takes none away', async () => {
  const ordered = inOrder();
  const answers = [];
  const asked = Array.from({ length: 5 }, () => ordered(new Promise((answer, fail) => answers.push({ answer, fail }))));
  answers[1].answer('second');
  answers[0].answer('first');
  answers[4].fail(new TypeError('away'));
  answers[3].answer(undefined);
  answers[2].answer('third');
  assert.deepEqual(await Promise.all(asked), [null, 'second', 'third', null, null]);
});
