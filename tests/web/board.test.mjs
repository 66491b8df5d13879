import assert from 'node:assert/strict';
import { test } from 'node:test';

import { figures, who } from '../../web/board/card.js';
import { ClassLink } from '../../web/board/class-link.js';
import { tellOutcome } from '../../web/board/outcome.js';
import { Panel } from '../../web/board/panel.js';
import { parsePictures } from '../../web/board/pictures.js';
import { loadLanguage } from '../../web/js/i18n.js';
import { encodePicture } from '../../web/js/protocol.js';

const picture = (frameId, bytes) => ({ frameId, capturedMs: 5, encoding: 'jpeg', width: 160, height: 120, nonce: 0, data: Uint8Array.from(bytes) });

/** What server/board/app.py sends. */
function pack(pictures) {
  const parts = pictures.map(([number, one]) => {
    const message = new Uint8Array(encodePicture(one));
    const part = new Uint8Array(6 + message.length);
    const view = new DataView(part.buffer);
    view.setUint16(0, number, true);
    view.setUint32(2, message.length, true);
    part.set(message, 6);
    return part;
  });
  return new Uint8Array(parts.flatMap((part) => [...part])).buffer;
}

test('the pictures of several robots in one message are separated again', () => {
  for (const count of [0, 1, 2, 30]) {
    const sent = Array.from({ length: count }, (_, i) => [i + 1, picture(i + 7, Array(i * 3).fill(i))]);
    const found = parsePictures(pack(sent));
    assert.deepEqual([...found.keys()], sent.map(([number]) => number));
    for (const [number, one] of sent) {
      assert.equal(found.get(number).frameId, one.frameId);
      assert.deepEqual([...found.get(number).data], [...one.data]);
    }
  }
});

test('strangers are listed separately from the robots of the class', () => {
  const link = new ClassLink('ws://board/ws/board');
  const told = [];
  for (const name of ['news', 'strangers']) link.addEventListener(name, ({ detail }) => told.push([name, detail]));
  const stranger = { address: 'http://10.0.0.9:80', status: 'not_ours', detail: 'the robot has the key of another class' };
  link.hear(JSON.stringify({ type: 'strangers', count: 1, some: [stranger] }));
  link.hear(JSON.stringify({ type: 'robots', robots: [{ number: 1 }] }));
  assert.deepEqual(told, [['strangers', { count: 1, some: [stranger] }], ['news', [{ number: 1 }]]]);
  assert.deepEqual([...link.robots.keys()], [1]);
});

test('the page drops robots that a restarted board does not know, so that no STOP button is without effect', (t) => {
  const lines = [];
  globalThis.WebSocket = class { constructor() { lines.push(this); } send() {} close() {} };
  t.after(() => delete globalThis.WebSocket);
  t.mock.timers.enable({ apis: ['setTimeout'] });
  const link = new ClassLink('ws://board/ws/board');
  const gone = [];
  link.addEventListener('gone', ({ detail }) => gone.push(...detail));
  const tell = (...numbers) => {
    const told = [{ type: 'robots', robots: numbers.map((number) => ({ number })) }, { type: 'strangers', count: 0, some: [] }];
    for (const words of told) lines.at(-1).onmessage({ data: JSON.stringify(words) });
  };
  link.connect();
  lines.at(-1).onopen();
  tell(1, 2);
  tell(3);
  assert.deepEqual(gone, [], 'later updates name only some of the robots');
  lines.at(-1).onclose();
  t.mock.timers.tick(1000);
  lines.at(-1).onopen();
  tell(1, 3);
  assert.deepEqual([gone, [...link.robots.keys()]], [[2], [1, 3]]);
});

test('the second card of a robot that has moved disappears', () => {
  const link = new ClassLink('ws://board/ws/board');
  const gone = [];
  link.addEventListener('gone', ({ detail }) => gone.push(...detail));
  link.hear(JSON.stringify({ type: 'robots', robots: [{ number: 1 }, { number: 2 }], gone: [] }));
  link.hear(JSON.stringify({ type: 'robots', robots: [{ number: 1 }], gone: [2] }));
  assert.deepEqual([gone, [...link.robots.keys()]], [[2], [1]]);
});

/** A board page with a fake websocket and fake requests; `open` opens a websocket, and `tell` sends an update on it. */
function paged(t) {
  const said = [], lines = [], asked = [], answers = [];
  globalThis.WebSocket = class { constructor() { lines.push(this); } send(text) { said.push(JSON.parse(text)); } close() { this.readyState = 3; } };
  globalThis.fetch = (path, { body }) => (asked.push(body), answers.shift() ?? Promise.reject(new TypeError('no board')));
  t.after(() => { delete globalThis.WebSocket; delete globalThis.fetch; });
  t.mock.timers.enable({ apis: ['setTimeout'] });
  const link = new ClassLink('ws://board/ws/board');
  link.connect();
  const hear = (words) => lines.at(-1).onmessage({ data: JSON.stringify(words) });
  return {
    link, asked, answers,
    open: () => { lines.at(-1).readyState = 1; lines.at(-1).onopen(); },
    end: () => { lines.at(-1).readyState = 3; lines.at(-1).onclose(); t.mock.timers.tick(1000); },
    tell: (...robots) => { hear({ type: 'robots', robots }); hear({ type: 'strangers', count: 0, some: [] }); },
    stops: () => said.filter(({ type }) => type === 'stop').map(({ robot }) => robot),
  };
}
const answer = (...robots) => Promise.resolve({ ok: true, json: async () => ({ robots }) });
const [ada, ben, cleo, dora] = ['http://a:1', 'http://b:1', 'http://c:1', 'http://d:1'].map((address) => (number) => ({ number, address }));

test('a STOP that reached no board is repeated once the next board knows the robot, unless it was released', async (t) => {
  const { link, asked, answers, open, end, tell, stops } = paged(t);
  open();
  tell(ada(1), ben(2), cleo(3), dora(4));
  end();
  answers.push(Promise.reject(new TypeError('no board')), answer({ ...ada(1), stop: null }, { ...ben(2), stop: 'asked' }), Promise.resolve({ ok: false, json: () => Promise.reject(new SyntaxError('no JSON')) }));
  for (const robot of [1, 2, 3, 4]) link.stop(robot); // a request delivers the STOP for 2
  link.release(4);
  await new Promise(setImmediate);
  assert.deepEqual(asked, ['{"robot":1}', '{"robot":2}', '{"robot":3}', '{"robot":4}']);
  open();
  tell();
  assert.deepEqual(stops(), [], 'a board without robots can stop none');
  tell(ada(1), ben(2), dora(4));
  assert.deepEqual(stops(), [1], 'the board does not know 3 yet');
  tell(cleo(3));
  tell(ada(1), cleo(3));
  assert.deepEqual(stops(), [1, 3], 'each STOP is repeated once');
  link.stop();
  assert.deepEqual([stops(), asked.length], [[1, 3, undefined], 4], 'an open websocket carries the STOP');
});

test('a STOP that reached no board is sent to the same robot, even if the next board gives it another number', (t) => {
  const { link, open, end, tell, stops } = paged(t);
  open();
  tell(ada(1), ben(2));
  end();
  link.stop(1);
  open();
  tell(ben(1));
  assert.deepEqual(stops(), [], 'number 1 is another robot now');
  tell(ada(2));
  assert.deepEqual(stops(), [2]);
});

test('a STOP for all that reached no board is sent to each robot that the next board finds, until it is released', async (t) => {
  for (const isAnswered of [false, true]) await t.test(isAnswered ? 'by a request' : 'by the websocket', async (t) => {
    const { link, answers, open, end, tell, stops } = paged(t);
    open();
    tell(ada(1), ben(2), cleo(3));
    end();
    // A board that has just started finds its robots one by one.
    if (isAnswered) answers.push(answer({ ...ben(1), stop: 'asked' }));
    link.stop();
    await new Promise(setImmediate);
    open();
    tell(ben(1));
    assert.deepEqual(stops(), isAnswered ? [] : [undefined, 1]);
    tell(ada(2));
    assert.equal(stops().at(-1), 2, 'otherwise a robot that is found later would drive on');
    link.release();
    tell(cleo(3));
    assert.equal(stops().at(-1), 2);
  });
});

for (const [what, fall] of Object.entries({
  'a board that hangs': () => {},
  'a board that ends before it reads the STOP': ({ end }) => end(),
})) {
  test(`a STOP sent to ${what} is repeated to the next board, and the page says that no board answers`, (t) => {
    const board = paged(t);
    const { link, open, tell, stops } = board;
    open();
    tell(ada(1), ben(2), cleo(3));
    link.stop(2);
    link.stop(3);
    link.release(3);
    fall(board);
    t.mock.timers.tick(3000);
    assert.equal(link.isOpen, false);
    t.mock.timers.tick(1000);
    open();
    tell(ada(1), ben(2), cleo(3));
    assert.deepEqual(stops(), [2, 3, 2]);
  });
}

test('a board that sends any update does not count as hanging', (t) => {
  const { link, open, tell } = paged(t);
  open();
  link.stop();
  t.mock.timers.tick(10_000);
  assert.ok(link.isOpen, 'without robots there are no updates');
  tell(ada(1));
  for (let i = 0; i < 5; i += 1) {
    link.stop();
    t.mock.timers.tick(2000);
    tell({ ...ada(1), stop: 'asked' });
    t.mock.timers.tick(2000);
  }
  assert.ok(link.isOpen);
});

test('a truncated message yields the pictures before the cut', () => {
  const whole = pack([[1, picture(1, [1, 2, 3])], [2, picture(2, [4, 5, 6])]]);
  for (let bytes = 0; bytes < whole.byteLength; bytes += 1) {
    assert.ok(parsePictures(whole.slice(0, bytes)).size <= (bytes >= whole.byteLength / 2 ? 1 : 0));
  }
});

test('a robot that has not answered yet may only be starting', () => {
  const robot = { status: 'away', detail: 'connection refused' };
  assert.equal(who(robot, 5000), 'board.status.connecting');
  assert.equal(who(robot, 60000), 'board.status.away');
  assert.equal(who(robot), 'board.status.away'); // the robot was there before
  assert.equal(who({ ...robot, status: 'not_ours' }, 5000), 'board.status.not_ours');
  assert.equal(who({ status: 'there', driven_by: 'pilot' }, 5000), 'board.who.pilot');
});

/** A panel of locks and its robots, whose answers the test gives. */
function locking(t, subject, locks, answer = new Promise(() => {})) {
  class FakeElement extends EventTarget {
    hidden = false;
    setAttribute(name, value) { this[name] = value; }
    append() {}
    querySelector() { return null; }
  }
  const boxes = {};
  globalThis.document = { createElement: () => new FakeElement() };
  const told = [];
  globalThis.fetch = (path, { body }) => (told.push([path.split('/').at(-1), JSON.parse(body).locks]), typeof answer === 'function' ? answer(path, body) : answer);
  t.after(() => { delete globalThis.document; delete globalThis.fetch; });
  t.mock.timers.enable({ apis: ['setTimeout'] });
  const robots = locks.map((own, i) => ({ number: i + 1, status: 'there', locks: own }));
  const panel = new Panel(new FakeElement(), () => robots);
  panel.subject = subject;
  const { createElement } = document;
  document.createElement = (tag) => {
    const element = createElement();
    if (tag === 'input') element.setAttribute = (name, value) => { element[name] = value; if (name === 'value') boxes[value] = element; };
    return element;
  };
  panel.locks(() => (subject === 'all' ? robots : robots.filter(({ number }) => number === subject)));
  return {
    told, robots,
    panel, tap: (lock) => { boxes[lock].checked = !boxes[lock].checked; boxes[lock].dispatchEvent(new Event('change')); },
    news: (number, own) => { robots[number - 1] = { ...robots[number - 1], locks: own }; panel.note(robots[number - 1]); },
    shown: () => Object.keys(boxes).filter((lock) => boxes[lock].checked),
  };
}

test('a lock for all keeps newer locks from another page, and also reaches robots that have joined since', (t) => {
  const { told, robots, tap, news, shown } = locking(t, 'all', [[], ['models']]);
  assert.deepEqual(shown(), []);
  news(1, ['gallery']); // on another page of the board
  robots.push({ number: 3, status: 'there', locks: [] });
  tap('settings');
  assert.deepEqual(told.splice(0), [['1', ['settings', 'gallery']], ['2', ['settings', 'models']], ['3', ['settings']]]);
  tap('recordings'); // before any robot has confirmed the first lock
  assert.deepEqual(told[0], ['1', ['settings', 'gallery', 'recordings']]);
  assert.deepEqual(shown(), ['settings', 'recordings']);
});

test('an open panel shows the current locks of its robot', (t) => {
  const { told, tap, news, shown } = locking(t, 2, [[], ['models', 'gallery']]);
  assert.deepEqual(shown(), ['models', 'gallery']);
  news(2, ['models', 'settings']);
  assert.deepEqual(shown(), ['settings', 'models']);
  tap('models');
  assert.deepEqual(told, [['2', ['settings']]]);
  news(2, ['models', 'settings']);
  assert.deepEqual(shown(), ['settings'], 'this update is older than the tap');
  news(2, ['settings']);
  news(2, ['settings', 'models']);
  assert.deepEqual(shown(), ['settings', 'models'], 'another page has locked it again');
});

test('a refused lock is shown as unlocked, and the next request does not repeat it', async (t) => {
  const refusal = { ok: false, status: 409, json: async () => ({ detail: 'It does not answer.' }) };
  const { told, tap, shown, panel } = locking(t, 'all', [[]], Promise.resolve(refusal));
  tap('models');
  assert.deepEqual(shown(), ['models']);
  await new Promise(setImmediate);
  assert.deepEqual(shown(), []);
  assert.equal(panel.said.textContent, 'It does not answer.');
  tap('gallery');
  assert.deepEqual(told.at(-1), ['1', ['gallery']]);
});

test('if one robot is away, the panel shows at once what the others have accepted', async (t) => {
  const answer = async (path, body) => path.endsWith('/2')
    ? { ok: false, status: 502, json: async () => ({ detail: 'It is away.' }) }
    : { ok: true, status: 200, json: async () => JSON.parse(body) };
  const { tap, shown, robots, panel } = locking(t, 'all', [['gallery'], []], answer);
  robots[1].status = 'away';
  tap('models');
  await new Promise(setImmediate);
  await new Promise(setImmediate);
  assert.equal(panel.said.textContent, 'It is away.');
  assert.deepEqual(shown(), ['models', 'gallery']);
});

test('a standing robot is not reported as slow, and the board shows what its pilots chose to show', async (t) => {
  globalThis.document = { documentElement: {} };
  t.after(() => { delete globalThis.document; });
  await loadLanguage([(code) => import(`../../web/board/messages/${code}.js`)]);
  const robot = { page: 'http://10.0.0.7:8000', agreement: null, lessons: 40, battery: null, busy: true, link: 'slow', delay_ms: null, shown: { challenge: { best_m: 3.25, tries: 3 } } };
  assert.deepEqual(figures({ ...robot, mode: 'stopped' }), ['challenge 3.3\u00a0m']);
  assert.deepEqual(figures({ ...robot, mode: 'train', shown: {} }), ['computer busy']);
  assert.deepEqual(figures({ ...robot, mode: 'train', shown: {}, busy: false }), ['slow link']);
  const [saved, empty] = ['Ada', ''].map((model) => tellOutcome({ name: 'Ada', did: 'reset', model, detail: '' }));
  assert.equal(saved, 'Ada starts over. Its old model is saved: Ada.');
  assert.equal(empty, 'Ada starts over.', 'a model without examples is not saved');
});
