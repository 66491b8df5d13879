import assert from 'node:assert/strict';
import { beforeEach, mock, test } from 'node:test';

import { LONG_MS, Refused, STOPPING_MS, ask, askLong, askToStop, inOrder } from '../../web/js/api.js';

beforeEach(() => mock.timers.enable({ apis: ['setTimeout'] }));
test.afterEach(() => {
  mock.timers.reset();
  delete globalThis.fetch;
});

/** Never settles unless the request is aborted. @param {AbortSignal} signal */
const silence = (signal) => new Promise((_, fail) => signal.addEventListener('abort', () => fail(new DOMException('aborted', 'AbortError'))));
/** Let `ms` pass, and return the request's result or error; null if it is still pending. */
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
      assert.equal(await after(ms - 1, asked), null, 'the page waits for a slow robot');
      assert.ok(await after(1, asked) instanceof TypeError, 'the same error as without a link');
    });
  }
}

test('a long request may take a minute, because a small computer is slow to measure itself or to read a recording', async () => {
  globalThis.fetch = (_, { signal }) => silence(signal);
  assert.equal(await after(60_000, askLong('api/settings')), null);
});

test('a truncated answer is an error, not an empty answer', async () => {
  for (const why of [new SyntaxError('Unexpected end of JSON input'), new TypeError('network error')]) {
    globalThis.fetch = async () => ({ ok: true, json: () => Promise.reject(why) });
    await assert.rejects(ask('GET', 'api/models'), TypeError);
  }
});

test('a refusal contains the robot’s sentence, or else the HTTP status', async () => {
  for (const [json, sentence] of [[async () => ({ detail: 'It drives.' }), 'It drives.'], [() => Promise.reject(new SyntaxError('<')), '502 Bad Gateway'], [async () => ({ detail: [1] }), '502 Bad Gateway']]) {
    globalThis.fetch = async () => ({ ok: false, status: 502, statusText: 'Bad Gateway', json });
    await assert.rejects(ask('GET', 'api/models'), (error) => error instanceof Refused && error.status === 502 && error.message === sentence);
  }
});

test('the page sends STOP requests one after the other, until the robot obeys or refuses, or the STOP is no longer wanted', async () => {
  const silent = ({ signal }) => silence(signal);
  const away = async () => { throw new TypeError('away'); };
  const says = (status) => async () => ({ ok: status < 300, status, json: async () => ({ emergency: true, stop_number: 7 }) });
  /** Send STOP, at most `owed` times, to a robot with these `answers` in turn; return the result and the number of requests. */
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
  assert.deepEqual(await end([away, says(403), says(200)]), [null, 2], 'an unpaired page stops asking');
  assert.deepEqual(await end([away, silent], 3), [null, 3]);
  const [earlier, later] = [askToStop(() => true), end([away, silent, says(200)])];
  assert.deepEqual(await later, [7, 3]);
  assert.equal(await earlier, null, 'the newer STOP replaced it');
});

test('an answer is dropped if a newer question was answered first; a failed question drops no answer', async () => {
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
