// Tilting the phone drives while a thumb rests on the pad.
// The phone's position when the thumb was put down counts as level.
// Browsers allow the sensor only on secure pages.

import { fromStick } from '../points.js';

const ON_DEG = 14;
const OFF_DEG = 9;
/** The tilt that counts as a fully pushed stick, in degrees. */
const FULL_DEG = 30;
/** Age in milliseconds above which the last value of a silent sensor is ignored. */
export const SILENT_MS = 400;

/** @typedef {{beta: number, gamma: number}} Lean  in degrees, from the browser */

/**
 * Return the move for a tilt of the phone from its initial position.
 * @param {Lean} now
 * @param {Lean} zero
 * @param {number} screenAngle  0, 90, 180 or 270 degrees
 * @param {string | null} before  the last requested move
 * @returns {string | null}
 */
export function readTilt(now, zero, screenAngle, before) {
  const [pitch, roll] = leaning(now, zero, screenAngle);
  const across = Math.abs(roll) > Math.abs(pitch);
  const lean = across ? Math.abs(roll) : Math.abs(pitch);
  const move = across ? (roll < 0 ? 'left' : 'right') : pitch < 0 ? 'forward' : 'backward';
  return lean > (move === before ? OFF_DEG : ON_DEG) ? move : null;
}

/** Convert a tilt to a point (to the right and ahead), like that of a thumb stick. @param {Lean} now @param {Lean} zero @param {number} screenAngle @param {import('../points.js').Reach} reach */
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
 * The change between two positions. Each position has two pairs of angles. If a phone is upright or overhead,
 * the browser jumps between the two pairs, so the nearest pair counts. @param {Lean} now @param {Lean} zero
 * @returns {[number, number]}
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

  /** Ask for permission to read the sensor if the browser requires it; return false if it is denied. */
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
    // Ask again, because an iPhone asks for permission on each visit, and only when a finger is lifted.
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
    // Safari before 16.4 has the angle only under its older name, from -90 to 180.
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
