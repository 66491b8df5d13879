// What the page needs of its device: a screen that stays on, and storage for preferences.

const KEY = 'drivelesson.preferences';

/** Keeps the screen on while `wanted` is true. Browsers keep the screen on only over https. */
export class WakeLock {
  constructor() {
    /** @type {any} */
    this.lock = null;
    this.isAsking = false;
  }

  /** Set whether the screen stays on. The page calls this with each state, so a change that comes while a request is under way is not lost. @param {boolean} wanted */
  async want(wanted) {
    const api = /** @type {any} */ (navigator).wakeLock;
    if (!api || this.isAsking) return;
    if (wanted && !this.lock && document.visibilityState === 'visible') {
      this.isAsking = true;
      this.lock = await api.request('screen').catch(() => null);
      this.isAsking = false;
      this.lock?.addEventListener('release', () => (this.lock = null));
    } else if (!wanted && this.lock) {
      await this.lock.release();
    }
  }
}

/** The browser's storage. If the browser forbids storage, values are kept as long as the page is open. @type {Pick<Storage, 'getItem' | 'setItem'>} */
export const memory = findMemory();

function findMemory() {
  try {
    const { localStorage: kept } = globalThis;
    kept.getItem(KEY);
    return kept;
  } catch {
    /** @type {Map<string, string>} */
    const kept = new Map();
    return { getItem: (/** @type {string} */ key) => kept.get(key) ?? null, setItem: (/** @type {string} */ key, /** @type {string} */ value) => void kept.set(key, value) };
  }
}

/** A person's preferences on this device. */
export class Preferences {
  constructor(storage = memory) {
    this.storage = storage;
    /** @type {Record<string, any>} */
    this.values = { vibrate: true, sound: true, tilt: false, sticks: [], pads: {}, hintsShown: [], ...read(storage) };
  }

  get vibrate() {
    return Boolean(this.values.vibrate);
  }

  get sound() {
    return Boolean(this.values.sound);
  }

  get tilt() {
    return Boolean(this.values.tilt);
  }

  /** @param {string} robot  its name */
  stickFor(robot) {
    return this.values.sticks.includes(robot);
  }

  /** @param {string} robot @param {boolean} isWanted */
  chooseStick(robot, isWanted) {
    const others = this.values.sticks.filter((/** @type {string} */ name) => name !== robot);
    this.set('sticks', isWanted ? [...others, robot] : others);
  }

  /** The directions of a game pad, as a person has shown them. @param {string} id @returns {import('./inputs/pad-rest.js').Choice | null} */
  padOf(id) {
    return this.values.pads[id] ?? null;
  }

  /** @param {string} id @param {import('./inputs/pad-rest.js').Choice} choice */
  choosePad(id, choice) {
    this.set('pads', { ...this.values.pads, [id]: choice });
  }

  /** @returns {string[]} the names of the hints of the first visit that were already shown */
  get hintsShown() {
    return this.values.hintsShown;
  }

  /** @param {string} name @param {unknown} value */
  set(name, value) {
    const kept = read(this.storage); // read again, because other tabs may have changed the preferences
    this.values[name] = value;
    try {
      this.storage.setItem(KEY, JSON.stringify({ ...this.values, ...kept, [name]: value }));
    } catch {} // if storage is full, the value is kept as long as the page is open
  }
}

/** @param {Pick<Storage, 'getItem'>} storage */
function read(storage) {
  try {
    return JSON.parse(storage.getItem(KEY) ?? '{}');
  } catch {
    return {};
  }
}
