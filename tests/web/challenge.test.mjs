import assert from 'node:assert/strict';
import { mock, test } from 'node:test';

import { offerChallenge } from '../../web/js/challenge/offer.js';
import { Store } from '../../web/js/store.js';

const LOOK_MS = 1500;
const NOW = { can_measure: true, is_armed: false, is_on: false, metres: 0, left_s: 60, tries: [], tries_of: 3, try_s: 60, best_m: null, is_shown: false };
const TRY = { metres: 1.9, seconds: 31, ended_by: 'touched' };

/** A page whose robot answers `now`; `look` lets it be asked once. */
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

test('a robot that is ready says so, then offers the challenge, and one that is not does not', async (context) => {
  context.after(() => mock.timers.reset());
  const { store, known, look } = await open({ readiness: { stage: 'teach' } }, NOW);
  assert.equal(store.state.toast, null);
  assert.equal(known(), false);
  store.set({ readiness: { stage: 'ready' } });
  await look();
  assert.equal(known(), true, 'it is in the menu');
  assert.equal(store.state.toast, null, 'pupils first read that the robot is ready');
  for (let i = 0; i < 3; i += 1) await look();
  assert.equal(store.state.toast.step.label, 'challenge.open');
  store.set({ screen: 'challenge' });
  assert.equal(store.state.toast, null, 'the screen says the same');
});

test('tries from before stay reachable while the robot needs another lesson', async (context) => {
  context.after(() => mock.timers.reset());
  const { known } = await open({ readiness: { stage: 'teach' } }, { ...NOW, tries: [TRY], best_m: 1.9 });
  assert.equal(known(), true);
});

test('the result of a try goes when another model is in use, and its robot is offered the challenge anew', async (context) => {
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

test('the next try is armed, and an older reason for standing does not hide what to do', async (context) => {
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
