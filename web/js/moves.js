// The robot's declared moves: labels, icons and places, for every screen that shows a move.

import { signs } from './dom.js';
import { language, learn } from './i18n.js';

/** @typedef {{name: string, label: Record<string, string>, icon: string, does: string, steering: number | null, throttle: number | null}} Move */

const CLASSIC = ['spin_left', 'left', 'forward', 'backward', 'right', 'spin_right'];
const PLACES = [-2, -1, 0, 0.5, 1, 2];
const LAST = 3;

/** @type {Map<string, Move>} */
const known = new Map();

/** Apply a driver's declaration; the page's own texts are used for what it leaves out. @param {Move[]} moves */
export function declare(moves) {
  for (const move of moves) {
    known.set(move.name, move);
    const label = move.label[language] ?? move.label.en;
    if (label) learn({ [`move.${move.name}`]: label, [`moves.${move.name}`]: `“${label}”` });
    if (move.icon) signs.set(move.name, move.icon);
  }
}

/** True for a move that has no place of its own on the pad. @param {string} move */
export const isOwn = (move) => !CLASSIC.includes(move);

/** Left before forward before right, as on the floor; a steered move by its angle. @param {string[]} moves */
export function byPlace(moves) {
  const place = (/** @type {string} */ move) => isOwn(move) ? known.get(move)?.steering ?? LAST : PLACES[CLASSIC.indexOf(move)];
  return [...moves].sort((a, b) => place(a) - place(b));
}
