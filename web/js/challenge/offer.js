// Offers the challenge once the robot is ready, and shows a try's progress and result.
// A robot without the challenge does not answer the requests for it, so nothing is offered.

import { ask } from '../api.js';
import { t } from '../i18n.js';
import { armTry, tellNow, tellTry } from './results.js';

const LOOK_MS = 1500;
const LOOKS_FIRST = 3; // number of checks before the offer, which would otherwise cover the message that the robot is ready

/** @typedef {import('./results.js').Challenge} Challenge */

/** @param {import('../page.js').Page} page @param {() => void} noteKnown  called when the pilot may know the challenge */
export function offerChallenge(page, noteKnown) {
  let isOffered = false;
  let readyFor = 0; // number of checks in a row at which the robot was ready
  let hasLooked = false; // true once the page knows the tries from before it was opened
  /** @type {Challenge | null} */
  let before = null;
  let said = '';
  const takeBack = () => { if (page.store.state.toast?.text === said) page.store.set({ toast: null }); };
  const open = () => { location.hash = 'challenge'; };
  const armNext = () => armTry(page).then(look, open);
  /** @param {string} label @param {() => void} act */
  const step = (label, act) => ({ label, act });
  const look = async () => {
    const { readiness, screen, lead, link } = page.store.state;
    if (link !== 'open' || screen !== 'drive' || lead || document.hidden) return;
    const isReady = readiness?.stage === 'ready';
    readyFor = isReady ? readyFor + 1 : 0;
    if (!isReady && !before && hasLooked) return;
    if (!isReady && page.store.state.toast?.text === t('challenge.offer')) { // the robot was taught something else, so the offer no longer applies
      page.store.set({ toast: null });
      isOffered = false;
    }
    const now = /** @type {Challenge | null} */ (await ask('GET', 'api/challenge').catch(() => null));
    hasLooked = true;
    page.store.set({ told: now && tellNow(now) });
    if (now && before && now.tries.length < before.tries.length) { // there are fewer tries than before, because another model is in use or three more tries begin
      takeBack();
      before = null;
      isOffered = false;
    }
    if (!now?.can_measure || !isReady && !now.tries.length && !now.is_armed && !now.is_on) return;
    noteKnown();
    const count = before && now.tries.length > before.tries.length ? now.tries.length : 0;
    const next = count < now.tries_of ? step(t('challenge.next'), armNext) : step(t('screen.challenge'), open);
    if (now.is_on) takeBack();
    if (count) page.toast((said = tellTry(now.tries[count - 1], count, now.tries_of)), next, Infinity);
    else if (!isOffered && !now.is_armed && !now.is_on && !now.tries.length && readyFor > LOOKS_FIRST) page.toast((said = t('challenge.offer')), step(t('challenge.open'), open), Infinity);
    isOffered ||= readyFor > LOOKS_FIRST;
    before = now;
  };
  page.store.watch(['screen'], ({ screen }) => { if (screen === 'challenge') takeBack(); }); // remove the offer on the challenge's screen, which says the same
  const goOn = () => setTimeout(() => look().finally(goOn), LOOK_MS);
  goOn();
}
