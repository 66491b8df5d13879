// The robot's declared moves: labels, icons and places, for every screen that shows a move.

import { signs } from './dom.js';
import { language, learn } from './i18n.js';

/** @typedef {{name: string, label: Record<string, string>, icon: string, does: string, steering: number | null, throttle: number | null}} Move */

const CLASSIC = ['spin_left', 'left', 'forward', 'backward', 'right', 'spin_right'];
const PLACES = [-2, -1, 0, 0.01, 1, 2];
const ASIDE = 0.05;
const LAST = 3;

/** @type {Map<string, Move>} */
const known = new Map();

/** Remember the moves that a driver declares; a move without a label gets the page's text. @param {Move[]} moves */
export function declare(moves) {
  for (const move of moves) {
    known.set(move.name, move);
    const label = move.label[language] ?? move.label.en;
    if (label) learn({ [`move.${move.name}`]: label, [`moves.${move.name}`]: `“${label}”` });
    if (move.icon) signs.set(move.name, move.icon);
  }
}

/** Steering and throttle of a move; null if its driver declares none. @param {string} move @returns {import('./points.js').Point | null} */
export function pointOf(move) {
  const { steering = null, throttle = null } = known.get(move) ?? {};
  return steering === null || throttle === null ? null : { steering, throttle };
}

/** True for a move without a fixed place on the pad. @param {string} move */
export const isOwn = (move) => !CLASSIC.includes(move);

/** Sort moves from left to right; moves that only some robots have are placed by their steering. @param {string[]} moves */
export function byPlace(moves) {
  return [...moves].sort((a, b) => place(a) - place(b));
}

/**
 * Three columns for many moves: moves to the left in the left column, moves to the right in the right column.
 * Null if a move has no declared steering. @param {string[]} moves @returns {{rows: number, areas:
 * Map<string, string>} | null} areas of the grid, by move
 */
export function inColumns(moves) {
  if (moves.some((move) => place(move) === LAST)) return null;
  const side = (/** @type {string} */ move) => Math.abs(place(move)) < ASIDE ? 0 : Math.sign(place(move));
  const columns = [-1, 0, 1].map((column) => moves.filter((move) => side(move) === column));
  const rows = Math.max(...columns.map((column) => column.length));
  const areas = new Map(columns.flatMap((column, x) => column.map((move, y) => {
    const [top, end] = [y, y + 1].map((edge) => Math.round(edge * rows / column.length) + 1);
    return /** @type {[string, string]} */ ([move, `${top} / ${x + 1} / ${end} / ${x + 2}`]);
  })));
  return { rows, areas };
}

/** Sort key of a move, from left to right. @param {string} move */
function place(move) {
  return isOwn(move) ? known.get(move)?.steering ?? LAST : PLACES[CLASSIC.indexOf(move)];
}
