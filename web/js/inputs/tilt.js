// Tilting the phone drives while a thumb rests on the pad. Upright is however it was held when the
// thumb went down. Browsers give the sensor to secure pages only.

import { fromStick } from '../points.js';

const ON_DEG = 14;
const OFF_DEG = 9;
/** By degrees, so far is a stick pushed to its end. */
const FULL_DEG = 30;
/** A sensor that is silent for so long says nothing about the phone any more. */
export const SILENT_MS = 400;

/** @typedef {{beta: number, gamma: number}} Lean  degrees, as the browser gives them */

/**
 * Which way the phone leans from where it was.
 * @param {Lean} now
 * @param {Lean} zero
 * @param {number} screenAngle  0, 90, 180 or 270 degrees
 * @param {string | null} before  what it asked for last
 * @returns {string | null}
 */
export function readTilt(now, zero, screenAngle, before) {
  const [pitch, roll] = leaning(now, zero, screenAngle);
  const across = Math.abs(roll) > Math.abs(pitch);
  const lean = across ? Math.abs(roll) : Math.abs(pitch);
  const move = across ? (roll < 0 ? 'left' : 'right') : pitch < 0 ? 'forward' : 'backward';
  return lean > (move === before ? OFF_DEG : ON_DEG) ? move : null;
}

/** The same as a stick's way to the right and ahead. @param {Lean} now @param {Lean} zero @param {number} screenAngle @param {import('../points.js').Reach} reach */
export function readTiltStick(now, zero, screenAngle, reach) {
  const [pitch, roll] = leaning(now, zero, screenAngle);
  return fromStick(roll / FULL_DEG, -pitch / FULL_DEG, reach);
}

/** @param {Lean} now @param {Lean} zero @param {number} angle @returns {[number, number]} pitch and roll */
function leaning(now, zero, angle) {
  const [beta, gamma] = between(now, zero);
  if (angle === 90) return [-gamma, beta];
  if (angle === 180) return [-beta, -gamma];
  if (angle === 270) return [gamma, -beta];
  return [beta, gamma];
}

/**
 * From one lean to another. Each lean has two names, and where a phone stands upright or hangs over a
 * head the browser leaps from one to the other: the nearest counts.
 * @param {Lean} now @param {Lean} zero @returns {[number, number]}
 */
function between({ beta, gamma }, zero) {
  const turn = (/** @type {number} */ deg) => deg - 360 * Math.round(deg / 360);
  /** @type {[number, number][]} */
  const ways = [[beta, gamma], [180 - beta, gamma + 180]].map(([b, g]) => [turn(b - zero.beta), turn(g - zero.gamma)]);
  return ways.reduce((a, b) => (Math.hypot(...b) < Math.hypot(...a) ? b : a));
}

export const hasTilt = () => isSecureContext && 'DeviceOrientationEvent' in globalThis;

export class Tilt {
  /** @param {import('../helm.js').Helm} helm */
  constructor(helm) {
    this.helm = helm;
    /** @type {Lean | null} */
    this.zero = null;
    /** @type {string | null} */
    this.move = null;
    /** @type {ReturnType<typeof setTimeout> | undefined} */
    this.silence = undefined;
    this.follow = this.follow.bind(this);
  }

  /** Ask the person where the browser wants that; false if it may not be. */
  static async allow() {
    if (!hasTilt()) return false;
    const sensor = /** @type {any} */ (DeviceOrientationEvent);
    if (!sensor.requestPermission) return true;
    return (await sensor.requestPermission().catch(() => 'denied')) === 'granted';
  }

  hold() {
    this.zero = null;
    this.helm.grasp('tilt');
    addEventListener('deviceorientation', this.follow);
  }

  letGo() {
    // An iPhone asks anew on each visit, and only as a finger comes up.
    if (!this.zero) Tilt.allow();
    this.move = null;
    clearTimeout(this.silence);
    removeEventListener('deviceorientation', this.follow);
    this.helm.release('tilt');
  }

  /** @param {DeviceOrientationEvent} event */
  follow({ beta, gamma }) {
    if (beta === null || gamma === null) return;
    clearTimeout(this.silence);
    const { helm } = this;
    this.silence = setTimeout(() => (helm.takesPoints ? helm.steer('tilt', null) : helm.release('tilt')), SILENT_MS);
    this.zero ??= { beta, gamma };
    // Safari before 16.4 has the angle by its older name alone, from -90 to 180.
    const angle = screen.orientation?.angle ?? ((globalThis.orientation ?? 0) + 360) % 360;
    if (helm.takesPoints) {
      helm.steer('tilt', readTiltStick({ beta, gamma }, this.zero, angle, helm.reach));
      return;
    }
    this.move = readTilt({ beta, gamma }, this.zero, angle, this.move);
    if (this.move) helm.press('tilt', this.move);
    else helm.release('tilt');
  }
}
