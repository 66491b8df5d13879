import assert from 'node:assert/strict';
import { test } from 'node:test';

import { urgentAdvice } from '../../web/js/advice.js';
import en from '../../web/js/messages/en.js';
import es from '../../web/js/messages/es.js';
import zh from '../../web/js/messages/zh.js';
import { initialState } from '../../web/js/store.js';
import { WayFinder, watchByRequests } from '../../web/js/way.js';

const ROBOT = { robot: 'Wren', mode: 'stopped', driven_by: 'nobody', action: 'stop', emergency: false };
const DRIVEN = { ...ROBOT, mode: 'train', driven_by: 'pilot', action: 'left' };
const ALONE = { ...ROBOT, mode: 'autonomous', driven_by: 'robot', action: 'forward' };
const refuse = (status, robot = null) => () => Promise.reject(Object.assign(new Error('open it at http://10.0.0.7'), { status, robot }));
const silent = () => Promise.reject(new TypeError('no answer'));
const say = (answer) => () => Promise.resolve(answer);

/** Lose the link this number of times; return the sentence that the page then shows. @param {{answer: () => Promise<any>, isOnline?: boolean, losses?: number, livesMs?: number}} way */
async function told({ answer, isOnline = true, losses = 3, livesMs }) {
  let [way, nowMs] = [null, 0];
  const finder = new WayFinder({ askState: answer, isOnline: () => isOnline, nowMs: () => nowMs, tell: (found) => (way = found) });
  for (let i = 0; i < losses; i += 1) {
    if (livesMs) finder.opened();
    nowMs += livesMs ?? 2000;
    await finder.lost();
  }
  const page = { ...initialState(), link: 'lost', way, robot: { you_are_pilot: true } };
  return urgentAdvice(/** @type {any} */ (page)).key;
}

// Causes of a broken link, and what the page says. It says that the robot stands only if the robot has answered so.
const WAYS = {
  'no route': [{ answer: silent }, 'out_of_reach'],
  refused: [{ answer: silent, losses: 2 }, 'out_of_reach'],
  'one answer is late': [{ answer: silent, losses: 1 }, 'searching'],
  'CONNECT refused, the robot stands': [{ answer: say(ROBOT) }, 'way.blocked.stands'],
  'CONNECT refused, another pilot drives': [{ answer: say(DRIVEN) }, 'way.blocked.driven'],
  'CONNECT refused, the robot drives by itself': [{ answer: say(ALONE) }, 'way.blocked.alone'],
  'too many pages': [{ answer: say({ ...ROBOT, is_full: true }) }, 'way.full'],
  'captive portal': [{ answer: say({ login: true }) }, 'way.foreign'],
  'websockets cut after 5 s': [{ answer: say(DRIVEN), livesMs: 5000, losses: 4 }, 'way.cut.driven'],
  'TLS inspected': [{ answer: silent }, 'out_of_reach'],
  'server stopped': [{ answer: silent }, 'out_of_reach'],
  'server restarted': [{ answer: say(ROBOT), losses: 1 }, 'searching'],
  'server starting': [{ answer: refuse(503, 'starts') }, 'way.starting'],
  'another address': [{ answer: refuse(421, 'refuses') }, 'fault'],
  asleep: [{ answer: silent }, 'out_of_reach'],
  'proxy without its robot': [{ answer: refuse(502) }, 'way.gateway'],
  'wrong port': [{ answer: refuse(404) }, 'way.foreign'],
  'airplane mode': [{ answer: silent, isOnline: false }, 'way.offline'],
};

for (const [what, [way, key]] of Object.entries(WAYS)) {
  test(`the page names the cause of a broken link: ${what}`, async () => assert.equal(await told(way), key));
}

test('a robot that restarts again and again does not count as a network that cuts connections', async () => {
  let [answer, way, nowMs] = [silent, null, 0];
  const finder = new WayFinder({ askState: () => answer(), isOnline: () => true, nowMs: () => nowMs, tell: (found) => (way = found) });
  for (let i = 0; i < 5; i += 1) {
    finder.opened();
    nowMs += 5000;
    answer = silent; // the robot is restarting
    await finder.lost();
    assert.equal(way.kind, 'checking');
    answer = say(ROBOT);
    await finder.lost();
    assert.equal(way.kind, 'checking');
  }
});

test('websockets that are refused after earlier ones were cut count as blocked', async () => {
  let [way, nowMs] = [null, 0];
  const finder = new WayFinder({ askState: say(ROBOT), isOnline: () => true, nowMs: () => nowMs, tell: (found) => (way = found) });
  for (let i = 0; i < 3; i += 1) {
    finder.opened();
    nowMs += 5000;
    await finder.lost();
  }
  assert.equal(way.kind, 'cut');
  for (const _ of [1, 2]) await finder.lost();
  assert.equal(way.kind, 'blocked');
});

test('while websockets are blocked, the page asks what the robot does; with a link it does not ask', async () => {
  let [answer, asked, way] = [ROBOT, 0, null];
  const askState = () => Promise.resolve(((asked += 1), answer));
  const finder = new WayFinder({ askState, isOnline: () => true, nowMs: () => 0, tell: (found) => (way = found) });
  for (const _ of [1, 2]) await finder.lost();
  assert.deepEqual(way, { kind: 'blocked', robot: 'stands' });
  answer = DRIVEN;
  await finder.again();
  assert.deepEqual(way, { kind: 'blocked', robot: 'driven' });
  finder.opened();
  await finder.again();
  assert.equal(asked, 3);
});

test('the sentence about the link disappears when the link is back, although a question is still pending', async () => {
  let [way, answer] = ['none', () => {}];
  const finder = new WayFinder({ askState: () => new Promise((done) => (answer = done)), isOnline: () => true, nowMs: () => 0, tell: (found) => (way = found) });
  const losing = finder.lost();
  finder.opened();
  answer(ROBOT);
  await losing;
  assert.equal(way, null);
});

test('no sentence about a lost link claims that the robot has stopped, in any language', () => {
  for (const words of [en, es, zh]) {
    for (const [key, sentence] of Object.entries(words)) {
      if (!/^(out_of_reach|searching|way\.)/.test(key) || key.endsWith('.stands')) continue;
      assert.doesNotMatch(sentence, /has stopped|stands|Se ha parado|está parado|已停下|停着/, `${key}: ${sentence}`);
    }
  }
});

test('the page offers once to watch if websockets are blocked', () => {
  const page = { ...initialState(), link: 'lost', way: { kind: 'blocked', robot: 'stands' }, robot: null };
  assert.equal(urgentAdvice(/** @type {any} */ (page)).step, 'watch');
  assert.equal(urgentAdvice(/** @type {any} */ ({ ...page, isWatching: true })).step, undefined);
});

test('pictures are requested one after the other, until the image is removed', (context) => {
  context.mock.timers.enable({ apis: ['setTimeout'] });
  const image = Object.assign(new EventTarget(), { isConnected: true, src: '' });
  watchByRequests(/** @type {any} */ (image));
  assert.match(image.src, /^picture\.jpg\?/);
  image.src = '';
  image.dispatchEvent(new Event('load'));
  context.mock.timers.tick(500);
  assert.match(image.src, /^picture\.jpg\?/);
  Object.assign(image, { isConnected: false, src: '' });
  image.dispatchEvent(new Event('error'));
  context.mock.timers.tick(9000);
  assert.equal(image.src, '');
});
