// Draws a scale with needles for the taught, the proposed and the driven steering.

import { h } from './dom.js';
import { t } from './i18n.js';

/**
 * @typedef {object} Needles  steering, from -1 (left) to 1
 * @property {number | null} [taught]  by the pilot
 * @property {number | null} [proposed]  by the robot
 * @property {number} [spread]  standard deviation of the proposed steering
 * @property {number | null} [driven]
 */

const KINDS = /** @type {const} */ (['proposed', 'taught', 'driven']);

export function makeNeedle() {
  return h('div', { class: 'needle', role: 'img' }, h('i', { class: 'sure' }), ...KINDS.map((kind) => h('i', { class: `at-${kind}` })));
}

/** @param {HTMLElement} needle @param {Needles} at */
export function turnNeedle(needle, at) {
  const [spread, ...hands] = /** @type {HTMLElement[]} */ ([...needle.children]);
  KINDS.forEach((kind, i) => turn(hands[i], at[kind]));
  turn(spread, at.proposed, Math.min(1, at.spread ?? 0));
  const said = KINDS.filter((kind) => at[kind] != null).map((kind) => t(`needle.${kind}`, { n: Math.round(100 * (at[kind] ?? 0)) }));
  needle.setAttribute('aria-label', [t('needle'), ...said].join(' · '));
}

/** @param {HTMLElement} hand @param {number | null} [to] @param {number} [wide] */
function turn(hand, to, wide = 1) {
  hand.hidden = to == null;
  if (to != null) hand.style.transform = `translateX(${50 * Math.max(-1, Math.min(1, to))}%) scaleX(${wide})`;
}
