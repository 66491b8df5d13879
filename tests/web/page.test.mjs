import assert from 'node:assert/strict';
import { beforeEach, mock, test } from 'node:test';

import { HINTS } from '../../web/js/hints.js';
import en from '../../web/js/messages/en.js';
import { initialState, Store } from '../../web/js/store.js';

const listeners = {};
const listen = (type, act) => (listeners[type] ??= []).push(act);
const fire = (type) => listeners[type].forEach((act) => act({}));
Object.assign(globalThis, { addEventListener: listen, document: { addEventListener: listen, hidden: false }, location: {} });
const { Page } = await import('../../web/js/page.js');
const { speak } = await import('../../web/js/i18n.js');
const { learnSession, refreshSession } = await import('../../web/js/study/session.js');

const STATE = {
  mode: 'stopped', you_are_pilot: true, pilot: 'c1', emergency: false, taught: { forward: 9, left: 3, right: 3 },
  lessons: 300, agreement: null, nonce: 7, stop_number: 41,
};
const OK = { ok: true, json: async () => ({}) };

let page;
let said;
let asked;
/** The answer to a request; it never settles if there is none. */
let answer;

beforeEach(() => {
  for (const type of Object.keys(listeners)) delete listeners[type];
  document.hidden = false;
  said = [];
  asked = [];
  answer = async () => OK;
  globalThis.fetch = (path, { method, signal }) => {
    if (method !== 'POST') return new Promise(() => {});
    asked.push(path);
    return Promise.race([answer(), new Promise((_, fail) => signal?.addEventListener('abort', () => fail(signal.reason)))]);
  };
  const connection = Object.assign(new EventTarget(), {
    isOpen: true, nonce: 7, delayMs: 5, seq: 0,
    send(text) {
      if (this.isOpen) said.push(JSON.parse(text));
      return this.isOpen;
    },
    say(type) { return this.send(JSON.stringify({ type })); },
    nextSeq() { return (this.seq += 1); },
    ageMs: () => 20, showPictures() {}, seek() {},
  });
  const preferences = { vibrate: false, hintsShown: ['teach', 'bars', 'correct'], stickFor: () => false, set() {} };
  page = new Page({ store: new Store(initialState()), connection, preferences, wakeLock: { want() {} } });
  page.look({ frame: 12, capturedMs: 0, arrivedMs: performance.now(), nonce: 7 });
  follow();
  said.length = 0;
  mock.timers.enable({ apis: ['setTimeout'] });
});

test.afterEach(() => mock.timers.reset());

const follow = (changes = {}) => page.follow({ ...STATE, ...changes });
const words = () => said.map(({ type, mode }) => mode ?? type).filter((word) => word !== 'drive');
const lose = () => {
  page.connection.isOpen = false;
  page.connection.dispatchEvent(new Event('lost'));
};
/** Let time pass, and let pending code run. */
async function pass(ms) {
  for (let gone = 0; gone <= ms; gone += 100) {
    if (gone) mock.timers.tick(100);
    await new Promise((done) => setImmediate(done));
  }
}

test('a STOP that is obeyed at once is not requested again', async () => {
  page.stop();
  await pass(100);
  follow({ emergency: true });
  await pass(10_000);
  assert.deepEqual([words(), asked.length], [['stop'], 0]);
});

for (const [what, become] of Object.entries({
  'cannot be sent': async () => { throw new TypeError('away'); },
  'are not answered': () => new Promise(() => {}),
  'do not get past a proxy': async () => ({ ok: false, status: 502, json: async () => ({}) }),
})) {
  test(`a STOP without a link is requested until the robot is back, although requests ${what}`, async () => {
    lose();
    answer = become;
    page.stop();
    await pass(8000);
    const before = asked.length;
    assert.ok(before >= 2, `${before} requests`);
    answer = async () => OK;
    await pass(4000);
    assert.ok(asked.length > before, 'the robot is back, and gets the STOP');
    const heard = asked.length;
    await pass(10_000);
    assert.equal(asked.length, heard, 'no request follows');
  });

  test(`a STOP that a state shows is not requested again, and can be released, although requests ${what}`, async () => {
    lose();
    answer = become;
    page.stop();
    await pass(400);
    page.connection.isOpen = true;
    follow({ emergency: true });
    const before = asked.length;
    page.release();
    await pass(10_000);
    assert.deepEqual([words(), asked.length], [['release'], before]);
  });
}

for (const [what, own, named] of [['a request of its own', 42, 42], ['another person', 43, 41]]) {
  test(`a release names the STOP that was shown, even if ${what} has stopped the robot since`, async () => {
    speak(en);
    lose();
    let reach;
    answer = () => new Promise((resolve) => { reach = resolve; });
    page.stop();
    page.connection.isOpen = true;
    follow({ emergency: true });
    page.release();
    reach({ ok: true, json: async () => ({ emergency: true, stop_number: own }) });
    await pass(500);
    assert.deepEqual(said.filter(({ type }) => type === 'release'), [{ type: 'release', stop_number: named }]);
    page.hearers.error({ type: 'error', code: 'newer_stop', message: '' });
    assert.equal(page.store.state.toast.text, en.newer_stop);
  });
}

test('a start that was tapped before a STOP is not repeated, although no state showed the STOP', () => {
  page.choose('train');
  follow({ stop_number: 42 });
  page.hearers.error({ type: 'error', code: 'stale', message: '', seq: page.connection.seq });
  page.look({ frame: 13, capturedMs: 0, arrivedMs: performance.now(), nonce: 8 });
  assert.deepEqual(words(), ['train']);
});

test('a STOP by a client that has no right to it is requested only once', async () => {
  lose();
  answer = async () => ({ ok: false, status: 401, json: async () => ({}) });
  page.stop();
  await pass(10_000);
  assert.equal(asked.length, 1);
});

for (const [what, come] of Object.entries({
  'a STOP': () => page.stop(),
  'a lost link': () => {
    lose();
    page.connection.isOpen = true;
  },
})) {
  test(`${what} cancels a waiting release`, async () => {
    lose();
    answer = () => new Promise(() => {});
    page.stop();
    page.connection.isOpen = true;
    follow({ emergency: true });
    page.release();
    await pass(500);
    assert.deepEqual(words(), [], 'the request is still pending');
    come();
    follow({ emergency: true });
    await pass(10_000);
    assert.ok(!words().includes('release'));
    page.release();
    await pass(10_000);
    assert.equal(words().at(-1), 'release');
  });
}

for (const [what, sight] of Object.entries({ 'is under way': 12, 'waits for a picture': null })) {
  test(`a start that ${what} is dropped when the page is hidden`, () => {
    if (!sight) page.looking = null;
    page.choose('autonomous');
    document.hidden = true;
    fire('visibilitychange');
    assert.equal(words().at(-1), 'stopped');
    document.hidden = false;
    fire('visibilitychange');
    page.look({ frame: 13, capturedMs: 0, arrivedMs: performance.now(), nonce: 8 });
    assert.equal(words().at(-1), 'stopped');
  });
}

test('the pilot sees a request for the wheel as long as it exists', () => {
  const shown = (changes) => (follow(changes), page.store.state.wheelAsked);
  page.note({ name: 'wheel_asked' });
  assert.equal(shown({ wheel_asked: true }), true);
  page.take('yield');
  assert.equal(shown({ wheel_asked: true, you_are_pilot: false }), false, 'the request now concerns another pilot');
  assert.equal(shown({ wheel_asked: true }), true, 'a new pilot sees the requests of others');
  assert.equal(shown({ wheel_asked: false }), false, 'the client that asked has left');
});

test('the page shows the newest step of a session, although an older answer arrives later', async () => {
  const answers = [];
  globalThis.fetch = () => new Promise((answer) => answers.push((step) => answer({ ok: true, json: async () => ({ session: { step } }) })));
  refreshSession(page);
  learnSession(page, Promise.resolve({ session: { step: 'drive' } })); // the result of a tap
  await pass(0);
  answers[0]('consent');
  await pass(0);
  assert.equal(page.store.state.lead.own.step, 'drive');
});

test('a STOP that was lost is the first message on the next link, until the robot shows it', async () => {
  const hello = { type: 'hello', role: 'pilot', robot: 'Ada', moves: [] };
  page.greet(hello);
  assert.deepEqual(words(), [], 'nobody has pressed it');
  lose();
  answer = () => new Promise(() => {});
  page.stop();
  page.connection.isOpen = true;
  page.greet(hello);
  assert.deepEqual(words(), ['stop']);
  follow({ emergency: true });
  page.greet(hello);
  assert.deepEqual(words(), ['stop'], 'a released robot is not stopped again');
});

test('a lost body or camera is named when it is back; other faults name neither', () => {
  speak(en);
  const toasts = [];
  page.toast = (text) => toasts.push(text);
  const hello = { role: 'pilot', robot: 'Wren', moves: ['forward'], device: "'Anna' (00:16:53)", camera_device: 'C270 (/dev/video0)' };
  page.greet(hello);
  page.greet(hello);
  assert.deepEqual(toasts.splice(0), ["Connected to 'Anna' (00:16:53)."], 'once');
  for (const stop_reason of ['drive_fault', 'camera_fault', 'store_fault']) {
    follow({ fault: 'gone', stop_reason });
    follow({ stop_reason });
  }
  assert.deepEqual(toasts.splice(0), ["Connected to 'Anna' (00:16:53), as before.", 'Connected to C270 (/dev/video0), as before.']);
  page.greet({ ...hello, device: "'Ben' (00:16:54)" });
  assert.deepEqual(toasts, ["Now connected to 'Ben' (00:16:54). Before, it was 'Anna' (00:16:53)."]);
});

test('the first visit shows three hints, each once; a hint disappears by itself while the robot moves', async () => {
  Object.assign(page.preferences, { hintsShown: [], set(name, value) { this[name] = value; } });
  const seen = [];
  const meet = (state) => {
    for (let i = 0; i < 2; i += 1) {
      follow(state);
      const { hint } = page.store.state;
      if (hint && hint !== seen.at(-1)) seen.push(hint);
    }
  };
  meet({ lessons: 0, taught: {} });
  meet({ mode: 'train', lessons: 90 });
  await pass(20_100);
  assert.equal(page.store.state.hint, null);
  for (let visit = 0; visit < 2; visit += 1) {
    meet({ mode: 'train', lessons: 90 });
    meet({ mode: 'autonomous', lessons: 90 });
    meet({ lessons: 90 });
  }
  assert.deepEqual([seen, page.preferences.hintsShown, page.store.state.hint], [HINTS, HINTS, null]);
});
