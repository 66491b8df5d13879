import assert from 'node:assert/strict';
import { mock, test } from 'node:test';

import { offerChallenge } from '../../web/js/challenge/offer.js';
import { Store } from '../../web/js/store.js';

const LOOK_MS = 1500;
const NOW = { can_measure: true, is_armed: false, is_on: false, metres: 0, left_s: 60, tries: [], tries_of: 3, try_s: 60, best_m: null, is_shown: false };
const TRY = { metres: 1.9, seconds: 31, ended_by: 'touched' };

/** A page whose robot answers `now`; `look` makes the page ask once. */
async function open(state, now) {
  const [asked, chosen] = [[], []];
  Object.assign(globalThis, {
    document: { hidden: false },
    location: {},
    fetch: async (path, { method }) => {
      asked.push(`${method} ${path}`);
      return new Response(JSON.stringify(now), { headers: { 'content-type': 'application/json' } });
    },
  });
  const store = new Store({ link: 'open', robot: { mode: 'stopped', you_are_pilot: true }, ...state });
  const page = { store, choose: (mode) => chosen.push(mode), toast: (text, step) => store.set({ toast: { text, step } }) };
  let isKnown = false;
  mock.timers.enable({ apis: ['setTimeout'] });
  offerChallenge(page, () => { isKnown = true; });
  const look = async () => {
    mock.timers.tick(LOOK_MS);
    for (let i = 0; i < 20; i += 1) await new Promise(setImmediate);
  };
  await look();
  return { store, asked, chosen, look, known: () => isKnown };
}

test('the page says that the robot is ready, and then offers the challenge; it offers nothing before that', async (context) => {
  context.after(() => mock.timers.reset());
  const { store, known, look } = await open({ readiness: { stage: 'teach' } }, NOW);
  assert.equal(store.state.toast, null);
  assert.equal(known(), false);
  store.set({ readiness: { stage: 'ready' } });
  await look();
  assert.equal(known(), true, 'the challenge is in the menu');
  assert.equal(store.state.toast, null, 'pupils first read that the robot is ready');
  for (let i = 0; i < 3; i += 1) await look();
  assert.equal(store.state.toast.step.label, 'challenge.open');
  store.set({ screen: 'challenge' });
  assert.equal(store.state.toast, null, 'the screen already says so');
});

test('earlier tries stay reachable while the robot needs another lesson', async (context) => {
  context.after(() => mock.timers.reset());
  const { known } = await open({ readiness: { stage: 'teach' } }, { ...NOW, tries: [TRY], best_m: 1.9 });
  assert.equal(known(), true);
});

test('a new model removes the result of a try, and the page offers the challenge again', async (context) => {
  context.after(() => mock.timers.reset());
  const now = { ...NOW };
  const { store, look } = await open({ readiness: { stage: 'ready' } }, now);
  now.tries = [TRY];
  await look();
  assert.equal(store.state.toast.step.label, 'challenge.next');
  now.tries = []; // as after “Reset all” on the board
  store.set({ readiness: { stage: 'teach' } });
  await look();
  assert.equal(store.state.toast, null);
  store.set({ readiness: { stage: 'ready' } });
  for (let i = 0; i < 4; i += 1) await look();
  assert.equal(store.state.toast.step.label, 'challenge.open');
});

test('a tap on “next” stops the robot, arms the next try, and opens the drive screen', async (context) => {
  context.after(() => mock.timers.reset());
  const now = { ...NOW };
  const { store, asked, chosen, look } = await open({ readiness: { stage: 'ready' } }, now);
  now.tries = [TRY];
  await look();
  store.state.toast.step.act();
  for (let i = 0; i < 20; i += 1) await new Promise(setImmediate);
  assert.ok(asked.includes('POST api/challenge/try'));
  assert.deepEqual(chosen, ['stopped']);
  assert.equal(location.hash, 'drive');
});
