// Proportional steering: a point is steering and throttle, each from -1 to 1, right and ahead positive.

import { pointOf } from './moves.js';

/** @typedef {{steering: number, throttle: number}} Point */
/** @typedef {{ahead: number, back: number}} Reach  the maximum throttle; back is 0 if the robot cannot reverse */

/** Share of a stick's travel up to which the stick counts as at rest. */
export const REST = 0.15;
const ASIDE = 0.06; // a stick that is pushed to the side by less than this share of its travel points straight ahead
const BACK_DEG = 115; // the robot reverses beyond this angle from straight ahead; it is so large that a stick pushed to the side never reverses
const TURNS_BEYOND = 0.2;

/**
 * A stick pushed ahead or aside drives faster the further it is pushed, and steers in proportion to its
 * sideways share. A stick pulled back reverses if the robot can. @param {number} x  to the right, as a share of
 * the travel @param {number} y  ahead @param {Reach} reach @returns {Point | null} null at rest
 */
export function fromStick(x, y, { ahead, back }) {
  const far = Math.hypot(x, y);
  const isBack = Math.abs(Math.atan2(x, y)) * 180 > BACK_DEG * Math.PI;
  if (far < REST || (isBack && !back)) return null;
  const push = beyond(Math.min(1, far), REST);
  return { steering: beyond((x / far) * push, ASIDE), throttle: isBack ? -back * push : ahead * push };
}

/** Return how far a stick is pushed beyond its dead zone, as a share of the rest of its travel. @param {number} way @param {number} dead */
export function beyond(way, dead) {
  return (Math.sign(way) * Math.max(0, Math.abs(way) - dead)) / (1 - dead);
}

/** The limits of proportional throttle: the greatest throttle of the robot's moves. @param {readonly string[]} moves @returns {Reach} */
export function reachOf(moves) {
  const most = (/** @type {number} */ way) => Math.max(0, ...moves.map((move) => way * (pointOf(move)?.throttle ?? 0)));
  return { ahead: most(1), back: most(-1) };
}

/** The move nearest to a point, like `move_at` in robot/moves.py. @param {Point} point @param {readonly string[]} moves @returns {string | null} */
export function moveOf({ steering, throttle }, moves) {
  const way = Math.sign(throttle);
  const goes = moves.filter((move) => Math.sign(pointOf(move)?.throttle ?? NaN) === way);
  const turns = goes.filter((move) => sideOf(pointOf(move)?.steering ?? 0) === sideOf(steering));
  const away = (/** @type {string} */ move) => {
    const at = pointOf(move);
    return at ? Math.hypot(at.steering - steering, at.throttle - throttle) : Infinity;
  };
  const choice = turns.length || !way ? turns : goes;
  return choice.length ? choice.reduce((best, move) => (away(move) < away(best) ? move : best)) : null;
}

/** @param {number} steering */
const sideOf = (steering) => (Math.abs(steering) > TURNS_BEYOND ? Math.sign(steering) : 0);
