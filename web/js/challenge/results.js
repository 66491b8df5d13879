// Texts about tries of the challenge.

import { ask } from '../api.js';
import { language, t } from '../i18n.js';

/**
 * @typedef {{metres: number, seconds: number, ended_by: string}} Try
 * @typedef {{can_measure: boolean, is_armed: boolean, is_on: boolean, metres: number, left_s: number,
 *   tries: Try[], tries_of: number, try_s: number, best_m: number | null, is_shown: boolean}} Challenge
 */

/** Have the robot count its next drive as a try, and show the drive screen. @param {import('../page.js').Page} page */
export async function armTry(page) {
  await ask('POST', 'api/challenge/try');
  const { robot } = page.store.state;
  if (robot?.you_are_pilot && robot.mode === 'stopped') page.choose('stopped'); // otherwise the reason for the stop would cover the text that says what to do
  location.hash = 'drive';
}

/** @param {number} metres */
export const metresOf = (metres) => metres.toLocaleString(language, { minimumFractionDigits: 1, maximumFractionDigits: 1 });

/** The text that is shown while a try waits for its start or is being driven. @param {Challenge} now @returns {import('../advice.js').Told | null} */
export function tellNow({ is_armed: isArmed, is_on: isOn, metres, left_s, tries, tries_of: of }) {
  if (isOn) return { key: 'challenge.left', n: tries.length + 1, of, metres: metresOf(metres), left_s };
  return isArmed ? { key: 'challenge.armed' } : null;
}

/** @param {Try} one @param {number} n @param {number} of */
export const tellTry = ({ metres, ended_by: by }, n, of) => t('challenge.result', { n, of, metres: metresOf(metres), why: t(`challenge.ended.${by}`) });
