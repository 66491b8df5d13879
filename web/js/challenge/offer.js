// Offers the challenge once the robot is ready, and says how a try went. A robot without this extension
// answers nothing here, and then nothing is offered.

import { ask } from '../api.js';
import { t } from '../i18n.js';
import { tellTry } from './results.js';

const LOOK_MS = 1500;

/** @typedef {import('./results.js').Challenge} Challenge */

/** @param {import('../page.js').Page} page */
export function offerChallenge(page) {
  let isOffered = false;
  /** @type {Challenge | null} */
  let before = null;
  const step = (/** @type {string} */ label) => ({ label, act: () => { location.hash = 'challenge'; } });
  const look = async () => {
    const { readiness, screen, lead, link } = page.store.state;
    if (link !== 'open' || screen !== 'drive' || lead || document.hidden || readiness?.stage !== 'ready' && !before) return;
    const now = await ask('GET', 'api/challenge').catch(() => null);
    if (!now?.can_measure) return;
    const count = before && now.tries.length > before.tries.length ? now.tries.length : 0;
    if (count) page.toast(tellTry(now.tries[count - 1], count, now.tries_of), step(t('screen.challenge')), Infinity);
    else if (!isOffered && !now.is_armed && !now.is_on && !now.tries.length && readiness?.stage === 'ready') page.toast(t('challenge.offer'), step(t('challenge.open')), Infinity);
    isOffered = true;
    before = now;
  };
  const goOn = () => setTimeout(() => look().finally(goOn), LOOK_MS);
  goOn();
}
