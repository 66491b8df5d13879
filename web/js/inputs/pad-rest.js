// Decides which inputs of a game pad count.
// An axis, a trigger or a button counts once it has been seen at rest.
// Therefore a pedal that rests at one end, a worn stick, or a throttle that nobody has touched does not drive the robot.
// Pure.

import { REST } from '../points.js';

/** An input within this share of its travel is at rest. */
const NEAR_AXIS = REST / Math.SQRT2;
export const PULLED = 0.05;
const STOP = 1;
/** The directions that a person shows for a pad of an unknown layout, in this order. */
export const DIRECTIONS = ['left', 'right', 'forward', 'backward'];
/** The minimum push by which a person shows a direction, as a share of the travel from the middle. */
const PUSHED = 0.5;
const STILL = 0.05;
/** How long an input must be still to count as released and at rest, in milliseconds. */
export const STILL_MS = 250;
/** How long a whole pad must be still before the page asks for its directions, in milliseconds. */
export const LET_GO_MS = 600;

/** @typedef {{kind: 'axes' | 'buttons', index: number, rest: number, full: number}} Input  its values at rest and when pushed */
/** @typedef {Record<string, Input>} Choice  the input of each direction */
/** @typedef {{axes: readonly number[], buttons: readonly {pressed: boolean, value?: number}[], mapping?: string, id?: string}} Pad */

/** @param {{pressed: boolean, value?: number} | undefined} button */
const valueOf = (button) => button?.value ?? Number(button?.pressed ?? false);
/** The values of all of a pad's axes, and then of its buttons. @param {Pad} pad */
export const valuesOf = (pad) => [...pad.axes, ...pad.buttons.map(valueOf)];
/** Two values of a cross on one axis are neighbours if they differ by less than this; a cross has eight values, 2/7 apart. */
const HAT_STEP = 0.3;
/** True for a cross that the browser reports as one axis: at rest its value is beyond the ends of an axis. @param {number} rest */
const isHat = (rest) => Math.abs(rest) > 1.1;
/** @param {Pad} pad @param {Input} input */
const wayOf = (pad, { kind, index, rest, full }) => {
  const value = kind === 'axes' ? pad.axes[index] ?? rest : valueOf(pad.buttons[index]);
  return isHat(rest) ? Number(Math.abs(value - full) < HAT_STEP) : (value - rest) / (full - rest);
};

/** Reads a pad as one of the standard layout. Inputs that were not seen at rest since the pad was connected count as not pushed. */
export class RestedPad {
  /** @param {Choice | null} [choice]  null: the pad has the standard layout */
  constructor(choice = null) {
    this.choice = choice;
    /** @type {Set<string>} inputs that were seen at rest */
    this.rested = new Set();
    /** @type {Set<string>} inputs that were not yet seen at rest */
    this.waiting = new Set();
  }

  /** @param {string} name @param {number} way  from -1 to 1; 0 is its rest */
  used(name, way) {
    if (Math.abs(way) <= (name.startsWith('button') ? PULLED : NEAR_AXIS)) this.rested.add(name);
    const isUsed = this.rested.has(name);
    if (isUsed) this.waiting.delete(name);
    else this.waiting.add(name);
    return isUsed ? way : 0;
  }

  /** @param {Pad} pad @returns {{axes: number[], buttons: {pressed: boolean, value: number}[]}} */
  read(pad) {
    const { choice } = this;
    if (!choice) {
      return {
        axes: pad.axes.slice(0, 2).map((way, i) => this.used(`axis ${i}`, way)),
        buttons: pad.buttons.map((button, i) => {
          const value = this.used(`button ${i}`, valueOf(button));
          return { value, pressed: button.pressed && (i === STOP || this.rested.has(`button ${i}`)) };
        }),
      };
    }
    const [left = 0, right = 0, ahead = 0, back = 0] = DIRECTIONS.map((name) =>
      choice[name] ? Math.min(1, Math.max(0, this.used(name, wayOf(pad, choice[name])))) : 0);
    const isDirection = Object.values(choice).some(({ kind, index }) => kind === 'buttons' && index === STOP);
    const stop = { value: 0, pressed: !isDirection && Boolean(pad.buttons[STOP]?.pressed) };
    return { axes: [right - left, back - ahead], buttons: [{ value: 0, pressed: false }, stop] };
  }
}

/**
 * Finds the input of each direction: a person pushes and releases each direction once. An input's value after the release is
 * its rest; the browser's values before the first report are ignored.
 */
export class PadChoice {
  /** @type {number | null} the moving input, by its index among the values */
  moving = null;
  full = 0;
  before = 0;
  stillMs = 0;

  /** @param {readonly string[]} directions  the directions to ask for */
  constructor(directions) {
    this.open = [...directions];
    /** @type {Choice} */
    this.choice = {};
    /** The pad's values while it was still, before the first question: its values at rest. @type {number[] | null} */
    this.lying = null;
    this.lyingMs = 0;
    this.isReady = false;
    this.begin();
  }

  /** @param {number[]} values @param {number} nowMs */
  waitForRest(values, nowMs) {
    const { lying } = this;
    if (lying?.length !== values.length || values.some((value, at) => Math.abs(value - lying[at]) > STILL)) {
      this.lying = values;
      this.lyingMs = nowMs;
    }
    this.isReady = nowMs - this.lyingMs >= LET_GO_MS;
  }

  begin() {
    /** @type {number[] | null} */
    this.base = null;
    this.moving = null;
    this.full = 0;
    this.before = 0;
    this.stillMs = 0;
  }

  /** The direction to push now; `rest`: release everything; undefined once all directions are known. */
  get asked() {
    return this.isReady || !this.open.length ? this.open[0] : 'rest';
  }

  /** Skip a direction that this pad does not have. */
  skip() {
    this.open.shift();
    this.begin();
  }

  /** @param {Pad} pad @param {number} nowMs */
  watch(pad, nowMs) {
    const values = valuesOf(pad);
    if (!this.isReady) this.waitForRest(values, nowMs);
    const { base } = this;
    if (!this.isReady || !this.open.length || !base || base.length !== values.length) {
      this.base = values;
      return;
    }
    if (this.moving === null) {
      const far = values.map((value, at) => Math.abs(value - base[at]));
      const most = far.indexOf(Math.max(...far));
      if (!(far[most] >= PUSHED)) return;
      this.moving = most;
      this.full = this.before = values[most];
    }
    const at = this.moving;
    const now = values[at];
    if (Math.abs(now - base[at]) > Math.abs(this.full - base[at])) this.full = now;
    if (Math.abs(now - this.before) > STILL || Math.abs(now - this.full) < PUSHED) {
      this.before = now;
      this.stillMs = nowMs;
      return;
    }
    if (nowMs - this.stillMs >= STILL_MS) this.take(at < pad.axes.length ? 'axes' : 'buttons', at < pad.axes.length ? at : at - pad.axes.length, now);
  }

  /** Note an input that was pushed and released. @param {'axes' | 'buttons'} kind @param {number} index @param {number} rest */
  take(kind, index, rest) {
    const { full, choice } = this;
    const isSame = (/** @type {Input} */ one) => (isHat(rest) ? Math.abs(one.full - full) < HAT_STEP : (one.full - one.rest) * (full - rest) > 0);
    const isTaken = Object.values(choice).some((one) => one.kind === kind && one.index === index && isSame(one));
    if (!isTaken) choice[this.open.shift() ?? ''] = { kind, index, rest, full };
    this.begin();
  }
}
