// The first visit's hints: each hint is shown once, at its moment, one hint at a time. Pure.

/** @typedef {{mode: string, lessons: number}} Moment */

const BARS_AFTER = 60; // number of examples after which the hint about the bars is shown: two or three seconds of driving

/** @type {Record<string, (robot: Moment) => boolean>} */
const MOMENTS = {
  teach: ({ mode, lessons }) => mode === 'stopped' && lessons === 0,
  bars: ({ mode, lessons }) => mode === 'train' && lessons >= BARS_AFTER,
  correct: ({ mode }) => mode === 'autonomous',
};

export const HINTS = Object.keys(MOMENTS);

/**
 * The hint for the current moment; null if there is none, or it was shown before.
 * @param {Moment} robot
 * @param {readonly string[]} shown  hints that were shown before
 */
export function hintNow(robot, shown) {
  return HINTS.find((hint) => !shown.includes(hint) && MOMENTS[hint](robot)) ?? null;
}
