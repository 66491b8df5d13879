// What is said about tries of the challenge.

import { language, t } from '../i18n.js';

/**
 * @typedef {{metres: number, seconds: number, ended_by: string}} Try
 * @typedef {{can_measure: boolean, is_armed: boolean, is_on: boolean, metres: number, left_s: number,
 *   tries: Try[], tries_of: number, try_s: number, best_m: number | null}} Challenge
 */

/** @param {number} metres */
export const metresOf = (metres) => metres.toLocaleString(language, { minimumFractionDigits: 1, maximumFractionDigits: 1 });

/** @param {Try} one @param {number} n @param {number} of */
export const tellTry = ({ metres, ended_by: by }, n, of) => t('challenge.result', { n, of, metres: metresOf(metres), why: t(`challenge.ended.${by}`) });
