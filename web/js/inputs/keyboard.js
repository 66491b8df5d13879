// Arrows and WASD drive while held (by degrees: the longer a key, the further it steers), the figures 1 to 9 whatever the robot can, in its order; space stops.

const STEP_MS = 40;
/** Shares of full lock in a step: what a key steers further, and what comes back without one. */
const OUT = 0.08;
const BACK = 0.16;

/** @type {Record<string, string>} */
const MOVES = {
  ArrowUp: 'forward', KeyW: 'forward',
  ArrowLeft: 'left', KeyA: 'left',
  ArrowRight: 'right', KeyD: 'right',
  ArrowDown: 'backward', KeyS: 'backward',
  KeyQ: 'spin_left', KeyE: 'spin_right',
};
const RAMPED = ['forward', 'backward', 'left', 'right'];

/** @param {EventTarget | null} target */
const isTyping = (target) =>
  target instanceof HTMLElement && target.matches('input:not([type=radio]), textarea, select');

/** Keys that steer by degrees. */
export class KeyRamp {
  /** @param {import('../helm.js').Helm} helm */
  constructor(helm) {
    this.helm = helm;
    /** @type {Map<string, string>} the move of each key that is down */
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
    if (!helm.holds.has('keys')) { // let go of by a stop, or by a page out of sight
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
 * @param {import('../helm.js').Helm} helm
 * @param {{stop: () => void, isDriving: () => boolean}} page  `isDriving`: the pad is on the screen
 */
export function listenToKeyboard(helm, { stop, isDriving }) {
  const ramp = new KeyRamp(helm);
  addEventListener('keydown', (event) => {
    // A Mac tells of no other key that comes up while Meta is down; the others open a browser's menu.
    if (['Meta', 'Alt', 'F10'].includes(event.key)) helm.releaseAll();
    if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target)) return;
    if (event.code === 'Space' && (helm.mode !== 'stopped' || event.target === document.body)) {
      // While the robot may move, space is the stop wherever the focus is; Enter presses buttons.
      event.preventDefault();
      if (!event.repeat) stop();
      return;
    }
    const nth = Number(event.code.match(/^Digit([1-9])$/)?.[1] ?? 0);
    const move = nth ? helm.moves[nth - 1] : MOVES[event.code];
    if (!move || !isDriving() || !helm.moves.includes(move)) return;
    event.preventDefault();
    if (event.repeat) return;
    if (helm.hasStick && !nth && RAMPED.includes(move)) ramp.press(event.code, move);
    else helm.press(`key ${event.code}`, move);
  });
  /** Nor does a browser tell of keys while a menu is open, or something is dragged. @param {Event} event */
  const letGo = ({ defaultPrevented: isNone }) => {
    if (!isNone) for (const source of helm.holds.keys()) if (source.startsWith('key')) helm.release(source);
  };
  addEventListener('contextmenu', letGo);
  addEventListener('dragstart', letGo);
  addEventListener('keyup', (event) => {
    helm.release(`key ${event.code}`);
    ramp.release(event.code);
    if (event.code === 'Space' && helm.mode !== 'stopped') event.preventDefault();
  });
}
