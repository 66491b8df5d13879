// Tells the pilot whether the robot is ready to drive by itself, and what is missing.
// The robot itself decides whether it is ready (docs/reference/http.md).
// This module asks the robot while the page is visible, and puts its answers into sentences.
// A request costs little: its answer contains no pictures, and requests are sent only while something changes.

import { ask } from '../api.js';
import { percent, t } from '../i18n.js';

const ASK_MS = 2000;
const SETBACK_MS = 8000;

const SETBACKS = ['corrected', 'pushed', 'helpless', 'unknown_view'];
const GONE_BACK_S = 5;

/**
 * The key of the text that says why the robot now has to drive by itself for longer than before; null if it does not.
 * @param {import('../advice.js').Readiness | null} before
 * @param {import('../advice.js').Readiness} now
 */
export function setbackOf(before, now) {
  const left = (/** @type {import('../advice.js').Readiness} */ { alone_needed_s: needed, alone_s: alone }) => needed - alone;
  if (!before || now.stage !== 'try' || left(now) - left(before) < GONE_BACK_S) return null;
  return now.missing.find(({ kind }) => SETBACKS.includes(kind))?.kind ?? null;
}

/** @param {boolean} pictures @returns {Promise<import('../advice.js').Readiness | null>} */
export function askReadiness(pictures) {
  return ask('GET', `api/teaching/readiness?pictures=${pictures}`).catch(() => null);
}

/** Keep the store's `readiness` up to date while the drive screen is visible. @param {import('../store.js').Store} store */
export function followReadiness(store) {
  let told = '';
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let forget;
  store.watch(['screen'], () => { told = ''; }); // forget the last text, because another screen may have moved the robot to another place
  const look = async () => {
    const { robot, link, screen } = store.state;
    if (link !== 'open' || !robot || screen !== 'drive' || document.hidden) return;
    const now = `${robot.mode}/${robot.lessons}`;
    if (robot.mode === 'stopped' && now === told) return;
    const readiness = await askReadiness(false);
    if (readiness) told = now;
    if (!readiness || JSON.stringify(readiness) === JSON.stringify(store.state.readiness)) return;
    const setback = setbackOf(store.state.readiness, readiness);
    store.set(setback ? { readiness, setback } : { readiness });
    if (!setback) return;
    clearTimeout(forget);
    forget = setTimeout(() => store.set({ setback: null }), SETBACK_MS);
  };
  /** Wait for each answer before the next request. Without this wait, requests would pile up on a slow link, and be answered in any order. */
  const goOn = () => setTimeout(() => look().finally(goOn), ASK_MS);
  goOn();
}

/** A gap as a sentence. @param {import('../advice.js').Gap} gap */
export function tellGap({ kind, move, instead, have, need, distance_m: far }) {
  const sentence = t(`gap.${kind}`, {
    move: move ? t(`move.${move}`) : '', moves: move ? t(`moves.${move}`) : '',
    instead: instead ? t(`move.${instead}`) : t('gap.nothing'), have: Math.floor(have), need, left: Math.max(1, Math.ceil(need - have)),
  });
  return far === null ? sentence : `${sentence} ${t('gap.far', { cm: Math.round(far * 100) })}`;
}

/** The stage as a sentence. @param {import('../advice.js').Readiness} readiness */
export function tellStage({ stage, alone_s: alone, alone_needed_s: needed, unknown_share: unknown }) {
  return t(`ready.${stage}`, { alone: Math.floor(alone), needed, left: Math.max(1, Math.ceil(needed - alone)), unknown: percent(unknown) });
}
