// Browser features that driving needs: keep the screen on, and report what is unavailable and why.

/** Keep the screen on while `wanted` is true; unavailable over plain HTTP. */
export class WakeLock {
  constructor() {
    /** @type {any} */
    this.lock = null;
    this.wanted = false;
  }

  /** @param {boolean} wanted */
  async want(wanted) {
    this.wanted = wanted;
    const api = /** @type {any} */ (navigator).wakeLock;
    if (!api) return;
    if (wanted && !this.lock && document.visibilityState === 'visible') {
      this.lock = await api.request('screen').catch(() => null);
      this.lock?.addEventListener('release', () => (this.lock = null));
    } else if (!wanted && this.lock) {
      await this.lock.release();
    }
  }
}

const KEY = 'drivelesson.preferences';

/** What this person wants on this device. */
export class Preferences {
  constructor(storage = localStorage) {
    this.storage = storage;
    /** @type {Record<string, any>} */
    this.values = { vibrate: true, sound: true, tilt: false, hintsShown: [], ...read(storage) };
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

  /** @returns {string[]} hints of the first visit that were shown */
  get hintsShown() {
    return this.values.hintsShown;
  }

  /** @param {string} name @param {unknown} value */
  set(name, value) {
    this.values[name] = value;
    this.storage.setItem(KEY, JSON.stringify(this.values));
  }
}

/** @param {Storage} storage */
function read(storage) {
  try {
    return JSON.parse(storage.getItem(KEY) ?? '{}');
  } catch {
    return {};
  }
}
