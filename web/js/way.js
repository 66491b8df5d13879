// Finds out why the websockets do not open, from the answers to HTTP requests.
// The page never claims that an unreachable robot stands still, because somebody else may drive it.

/** If websockets repeatedly end within this time after they opened, the network cuts them. */
const CUT_MS = 20_000;
const CUTS = 3;
/** After this many websockets in a row that did not open, the page says that the network blocks them. */
const UNOPENED = 2;
const PICTURE_MS = 500;

/**
 * @typedef {object} Way
 * @property {'checking' | 'silent' | 'offline' | 'gateway' | 'foreign' | 'full' | 'blocked' | 'cut' | 'starting' | 'refused'} kind
 * @property {'stands' | 'driven' | 'alone' | 'unknown'} robot  the robot's activity, from its answer to a request
 * @property {string} [words]  the robot's sentence, if it refuses
 */

/** Return what the robot does, according to its answer to an HTTP request. @param {any} answer @returns {Way['robot']} */
export function doingOf(answer) {
  if (answer.mode === 'stopped') return 'stands';
  return answer.driven_by === 'robot' ? 'alone' : 'driven';
}

/** True if a robot has answered, and not another server at its address. @param {any} answer */
const isRobots = (answer) => typeof answer?.mode === 'string' && typeof answer.driven_by === 'string';

/**
 * Finds the reason by a request after each lost connection.
 * @typedef {object} WayParts
 * @property {() => Promise<any>} askState  rejects with a `status` if it was refused
 * @property {() => boolean} isOnline
 * @property {() => number} nowMs
 * @property {(way: Way | null) => void} tell
 */
export class WayFinder {
  /** @param {WayParts} parts */
  constructor(parts) {
    this.parts = parts;
    this.isAsking = false;
    this.isOpen = false;
    this.openedMs = -Infinity;
    /** When the last websocket was lost: soon after it opened (`cut`), later (`ended`), or before it opened; null once the loss is counted.
     * @type {'cut' | 'ended' | 'unopened' | null} */
    this.loss = null;
    /** Numbers of websockets in a row that were cut, and that did not open, although the robot answered HTTP requests. */
    this.cuts = 0;
    this.unopened = 0;
    this.era = 0;
    /** Number of HTTP requests in a row without an answer. A single missing answer may only mean that the robot's computer is busy. */
    this.silences = 0;
    /** @type {Way | null} */
    this.told = null;
  }

  /** @param {Way | null} way */
  tell(way) {
    this.told = way;
    this.parts.tell(way);
  }

  opened() {
    this.isOpen = true;
    this.era += 1;
    this.openedMs = this.parts.nowMs();
    this.tell(null);
  }

  /** Ask once a second what the robot does, because somebody may have started it since. */
  async again() {
    if (this.told?.kind === 'blocked' || this.told?.kind === 'cut') await this.look();
  }

  async lost() {
    const isShort = this.parts.nowMs() - this.openedMs < CUT_MS;
    this.loss = this.isOpen ? (isShort ? 'cut' : 'ended') : 'unopened';
    this.isOpen = false;
    await this.look();
  }

  /** Count lost websockets while the robot answers HTTP requests; the page blames the network only for repeated losses. */
  count() {
    const { loss } = this;
    this.loss = null;
    if (loss) this.unopened = loss === 'unopened' ? this.unopened + 1 : 0;
    if (loss === 'cut') this.cuts += 1;
    if (loss === 'ended') this.cuts = 0;
    if (this.unopened >= UNOPENED) return 'blocked';
    return this.unopened === 0 && this.cuts >= CUTS ? 'cut' : 'checking';
  }

  async look() {
    const { parts } = this;
    if (this.isAsking) return;
    this.isAsking = true;
    const { era } = this;
    const way = await this.find();
    this.isAsking = false;
    if (era === this.era) this.tell(way);
  }

  /** @returns {Promise<Way>} */
  async find() {
    if (!this.parts.isOnline()) return { kind: 'offline', robot: 'unknown' };
    try {
      const answer = await this.parts.askState();
      this.silences = 0;
      if (!isRobots(answer)) return { kind: 'foreign', robot: 'unknown' };
      return { kind: answer.is_full ? 'full' : this.count(), robot: doingOf(answer) };
    } catch (error) {
      this.cuts = this.unopened = 0; // start counting again, because the robot or the whole network was away
      this.loss = null;
      const { status, robot, message } = /** @type {{status?: number, robot?: string, message: string}} */ (error);
      this.silences = status === undefined ? this.silences + 1 : 0;
      if (status === undefined) return { kind: this.silences > 1 ? 'silent' : 'checking', robot: 'unknown' };
      if (robot === 'starts') return { kind: 'starting', robot: 'unknown' };
      if (robot) return { kind: 'refused', robot: 'unknown', words: message };
      return { kind: status >= 502 && status <= 504 ? 'gateway' : 'foreign', robot: 'unknown' };
    }
  }
}

/** Show pictures one by one by HTTP requests, as long as the image is on the page. @param {HTMLImageElement} image */
export function watchByRequests(image) {
  const next = () => {
    if (image.isConnected) image.src = `picture.jpg?${Date.now()}`;
  };
  image.addEventListener('load', () => setTimeout(next, PICTURE_MS));
  image.addEventListener('error', () => setTimeout(next, 4 * PICTURE_MS));
  next();
}
