// Arrows and WASD drive while held.
// With proportional steering, a key steers further the longer it is held.
// The digits 1 to 9 drive the robot's moves, in the order of the robot's list.
//
// If the browser does not say which key was released, all keys count as released.

import { isEnter } from './key-name.js';
import { moveOfKey, Presses } from './keys.js';

const STEP_MS = 40;
/** How far the steering moves per step, as a share of full lock: while a key is held, and back after its release. */
const OUT = 0.08;
const BACK = 0.16;

const RAMPED = ['forward', 'backward', 'left', 'right'];
/** A repeating key that is silent for twice its longest pause counts as released. The two numbers are the lower and the upper limit of this time. */
const [QUIET_MS, LONG_MS] = [1000, 2500];
/** How long the older keys of a chord count as held after the newest key was released, if no other key is pressed. */
const CHORD_MS = 5000;

/** @param {EventTarget | null} target */
const isTyping = (target) =>
  target instanceof HTMLElement && target.matches('input:not([type=radio]), textarea, select');

/** Keys that steer proportionally. */
export class KeyRamp {
  /** @param {import('../helm.js').Helm} helm */
  constructor(helm) {
    this.helm = helm;
    /** @type {Map<string, string>} the move of each pressed key */
    this.keys = new Map();
    this.steering = 0;
    /** @type {ReturnType<typeof setInterval> | undefined} */
    this.timer = undefined;
  }

  /** @param {string} key @param {string} move */
  press(key, move) {
    if (!this.helm.holds.has('keys')) {
      this.letGo();
      this.helm.grasp('keys');
      this.timer = setInterval(() => this.step(), STEP_MS);
    }
    this.keys.set(key, move);
    this.step();
  }

  /** @param {string} key */
  release(key) {
    if (this.keys.delete(key) && !this.keys.size) this.letGo();
  }

  letGo() {
    clearInterval(this.timer);
    this.keys.clear();
    this.steering = 0;
    this.helm.release('keys');
  }

  step() {
    const { helm } = this;
    if (!helm.holds.has('keys')) { // a stop or the hiding of the page has released everything
      this.letGo();
      return;
    }
    const moves = [...this.keys.values()];
    const wanted = Number(moves.includes('right')) - Number(moves.includes('left'));
    const step = wanted * this.steering < 0 || !wanted ? BACK : OUT;
    this.steering += Math.max(-step, Math.min(step, wanted - this.steering));
    const { ahead, back } = helm.reach;
    const isBack = moves.includes('backward') && !moves.includes('forward');
    helm.steer('keys', { steering: this.steering, throttle: isBack ? -back : ahead });
  }
}

/**
 * Detects that a key was released without an event: browsers send none while a screenshot is taken, or with some
 * window managers. A key that repeated and fell silent counts as released. The older keys of a chord do not repeat;
 * they count as released some time after the newest key was released.
 */
class Silence {
  /** @param {() => void} letGo */
  constructor(letGo) {
    this.letGo = letGo;
    this.newest = '';
    this.atMs = 0;
    /** The longest pause between two events of a held key; 0 if no key has repeated yet. */
    this.pauseMs = 0;
    /** @type {string[]} the keys that were counted as released */
    this.missed = [];
    /** Which silence was last taken for a release: true for the silence of a chord's older keys, false for the silence of a repeating key. */
    this.isChord = false;
    /** The kinds of silence that are no longer taken for a release, because a key was reported as released later. */
    this.isWrong = { chord: false, repeat: false };
    /** @type {ReturnType<typeof setTimeout> | undefined} */
    this.timer = undefined;
  }

  /** @param {string} press @param {boolean} isRepeat */
  heard(press, isRepeat) {
    const nowMs = performance.now();
    if (isRepeat && press === this.newest) this.pauseMs = Math.max(this.pauseMs, nowMs - this.atMs);
    Object.assign(this, { newest: press, atMs: nowMs, missed: [] });
    clearTimeout(this.timer);
    if (this.pauseMs && !this.isWrong.repeat) this.wait(false, [press], Math.min(LONG_MS, Math.max(QUIET_MS, 2 * this.pauseMs)));
  }

  /** @param {string | null} press @param {string[]} others  the keys that are still down */
  over(press, others) {
    clearTimeout(this.timer);
    if (press && this.missed.includes(press)) this.isWrong[this.isChord ? 'chord' : 'repeat'] = true;
    this.missed = [];
    if (others.length && !this.isWrong.chord) this.wait(true, others, CHORD_MS);
  }

  /** @param {boolean} isChord @param {string[]} presses @param {number} ms */
  wait(isChord, presses, ms) {
    this.timer = setTimeout(() => {
      Object.assign(this, { isChord, missed: presses });
      this.letGo();
    }, ms);
  }
}

/**
 * @param {import('../helm.js').Helm} helm
 * @param {{isDriving: () => boolean}} page  `isDriving` returns true if the pad is on the screen
 */
export function listenToKeyboard(helm, { isDriving }) {
  const ramp = new KeyRamp(helm);
  const presses = new Presses();
  const letGo = () => {
    for (const source of [...helm.holds.keys()]) if (source.startsWith('key')) helm.release(source);
  };
  const silence = new Silence(letGo);
  addEventListener('keydown', (event) => silence.heard(presses.press(event), event.repeat), true);
  addEventListener('keydown', (event) => {
    // A Mac reports no other key's release while Meta is down; Alt and F10 open a browser's menu.
    if (['Meta', 'Alt', 'F10'].includes(event.key)) helm.releaseAll();
    // Browsers click the focused element on Enter, but not on a remote control's other names for Enter.
    const { target } = event;
    if (isEnter(event) && event.key !== 'Enter' && !event.defaultPrevented && !event.repeat && target instanceof HTMLElement && target.matches('a, button')) target.click();
    if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target)) return;
    const { move, isNth } = moveOfKey(event, helm.moves);
    if (!move || !isDriving() || !helm.moves.includes(move)) return;
    event.preventDefault();
    if (event.repeat) return;
    const press = presses.press(event);
    if (helm.hasStick && !isNth && RAMPED.includes(move)) ramp.press(press, move);
    else helm.press(`key ${press}`, move);
  });
  /** Browsers also report no keys while a menu is open or something is dragged. @param {Event} event */
  const turnAway = ({ defaultPrevented: isNone }) => {
    if (!isNone) letGo();
  };
  addEventListener('contextmenu', turnAway);
  addEventListener('dragstart', turnAway);
  addEventListener('keyup', (event) => {
    const press = presses.release(event);
    silence.over(press, presses.down.map(({ id }) => id).filter((id) => helm.holds.has(`key ${id}`) || ramp.keys.has(id)));
    if (press === null) return letGo();
    helm.release(`key ${press}`);
    ramp.release(press);
  }, true);
  addEventListener('blur', () => {
    presses.clear();
    silence.over(null, []);
  });
}
