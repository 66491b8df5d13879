// The page's two websockets, which connect again when they close. A new connection does not send earlier commands again.

import {
  encodeAcknowledgement,
  encodePing,
  encodeWord,
  parsePicture,
  parseWords,
} from './protocol.js';

const SILENCE_MS = 1500; // time without a message after which the link counts as dead; states arrive ten times a second
const PICTURE_MS = 5000; // time after which the video socket counts as dead if states name newer pictures but no picture arrives
const FIRST_RETRY_MS = 250;
const LAST_RETRY_MS = 2000;
const PING_EVERY_MS = 1000;
const CLOCK_SAMPLES = 8;
const IDLE_SILENCE_MS = 4000; // like SILENCE_MS, for an idle page, which receives little more than a pong each second

/**
 * Events: `open` and `lost`; and `words` and `picture`, whose `detail` is the message.
 *
 * @typedef {object} Environment  the browser's functions, which tests replace
 * @property {new (url: string) => WebSocket} WebSocket
 * @property {() => number} nowMs
 * @property {(f: () => void, ms: number) => number} setTimeout
 * @property {(id: number) => void} clearTimeout
 * @property {() => boolean} [isHidden]  true if nobody can see the page
 */
export class Connection extends EventTarget {
  /** @param {string} base such as ws://host:8000 @param {Partial<Environment>} [environment] */
  constructor(base, environment = {}) {
    super();
    this.base = base;
    /** @type {Environment} */
    this.env = {
      WebSocket: globalThis.WebSocket,
      nowMs: () => performance.now(),
      setTimeout: (f, ms) => /** @type {any} */ (globalThis.setTimeout(f, ms)),
      clearTimeout: (id) => globalThis.clearTimeout(id),
      isHidden: () => Boolean(globalThis.document?.hidden),
      ...environment,
    };
    this.retryMs = FIRST_RETRY_MS;
    this.seq = 0;
    /** @type {WebSocket | null} */
    this.drive = null;
    /** @type {WebSocket | null} */
    this.video = null;
    /** @type {{rttMs: number, offsetMs: number}[]} */
    this.samples = [];
    /** @type {number | null} the newest nonce, which commands return */
    this.nonce = null;
    this.nonceMs = -Infinity;
    /** @type {number | null} the picture on the screen */
    this.frame = null;
    this.showsPictures = true;
    this.isDrawn = true;
    /** @type {Pick<Worker, 'postMessage'> | null} the worker that receives and draws pictures instead of this thread */
    this.worker = null;
    /** @type {Record<string, number>} */
    this.timers = {};
  }

  get isOpen() {
    return this.drive?.readyState === 1;
  }

  /** Round trip of the last ping; null before the first. */
  get delayMs() {
    return this.samples[this.samples.length - 1]?.rttMs ?? null;
  }

  /** Return the age of a time on the server's clock; null before the first pong. @param {number} serverMs */
  ageMs(serverMs) {
    if (!this.samples.length) return null;
    // The shortest round trip gives the best estimate of the clock offset.
    const best = this.samples.reduce((a, b) => (b.rttMs < a.rttMs ? b : a));
    return Math.max(0, this.env.nowMs() + best.offsetMs - serverMs);
  }

  /** Connect now, and request pictures as soon as it is known whether a worker or the page draws them. @param {Promise<unknown>} ready */
  async begin(ready) {
    this.isDrawn = false;
    this.connect();
    await ready;
    this.isDrawn = true;
    if (this.isOpen && this.showsPictures) this.openVideo();
  }

  connect() {
    this.cancel('retry');
    this.dropSockets();
    this.seq = 0;
    this.samples = [];
    this.nonce = null;
    this.nonceMs = this.env.nowMs();
    const drive = (this.drive = new this.env.WebSocket(`${this.base}/ws/drive`));
    drive.onopen = () => this.opened();
    drive.onmessage = ({ data }) => this.heard(data);
    drive.onclose = drive.onerror = () => this.lose();
    this.expectWord(SILENCE_MS * 2);
  }

  /** Drop the sockets and connect again at once, for example after the page returns from the cache. */
  reconnect() {
    this.retryMs = FIRST_RETRY_MS;
    this.lose();
  }

  /** The page became visible: connect at once if there is no link. */
  seek() {
    if (!this.isOpen) this.connect();
  }

  /** Close the connection for good. */
  close() {
    for (const name of Object.keys(this.timers)) this.cancel(name);
    this.dropSockets();
  }

  /** Send one message; false if the link is down. @param {string} text */
  send(text) {
    if (!this.isOpen) return false;
    this.drive?.send(text);
    return true;
  }

  /** Send a message without fields. @param {import('./protocol.js').Word} type */
  say(type) {
    return this.send(encodeWord(type));
  }

  nextSeq() {
    this.seq += 1;
    return this.seq;
  }

  /** Let a worker receive the pictures. @param {Worker} worker */
  useWorker(worker) {
    this.worker = worker;
    worker.onmessage = ({ data }) => {
      if (data.closed) this.videoClosed();
      if (data.shown) this.noteShown(data.shown);
    };
  }

  /** Remember a nonce, unless a newer one is known. The newer the nonce, the fresher the command that returns it. @param {number | undefined} nonce  0 or undefined means no nonce @param {number} [cameMs] */
  learn(nonce, cameMs = this.env.nowMs()) {
    if (!nonce || cameMs < this.nonceMs) return;
    this.nonce = nonce;
    this.nonceMs = Math.min(cameMs, this.env.nowMs()); // the clock of a worker may be ahead of ours
  }

  /** Called when a picture is on the screen. @param {import('./painter.js').Shown} shown */
  noteShown(shown) {
    this.learn(shown.nonce, shown.arrivedMs);
    this.frame = shown.frame;
    this.cancel('picture');
    this.emit('shown', shown);
  }

  /** @param {number} frameId */
  acknowledge(frameId) {
    if (this.video?.readyState === 1) this.video.send(encodeAcknowledgement(frameId));
  }

  opened() {
    if (this.showsPictures) this.openVideo();
    else this.say('idle');
    this.ping();
    this.dispatchEvent(new Event('open'));
  }

  /** Start or stop requesting pictures; they are wanted only while they are shown. @param {boolean} wanted */
  showPictures(wanted) {
    if (wanted === this.showsPictures) return;
    this.showsPictures = wanted;
    if (!this.isOpen) return;
    this.say(wanted ? 'watch' : 'idle');
    if (wanted) this.openVideo();
    else this.dropVideo();
  }

  dropVideo() {
    const { video } = this;
    this.video = null;
    this.cancel('video');
    this.cancel('picture');
    this.worker?.postMessage({ close: true });
    if (!video) return;
    video.onmessage = video.onclose = null;
    video.close();
  }

  openVideo() {
    this.dropVideo();
    if (!this.isDrawn) return;
    const url = `${this.base}/ws/video`;
    if (this.worker) {
      this.worker.postMessage({ open: url });
      return;
    }
    const video = (this.video = new this.env.WebSocket(url));
    video.binaryType = 'arraybuffer';
    video.onmessage = ({ data }) => {
      const picture = parsePicture(data);
      this.learn(picture.nonce);
      this.emit('picture', picture);
    };
    video.onclose = () => this.video === video && this.videoClosed();
  }

  videoClosed() {
    if (this.isOpen) this.after('video', FIRST_RETRY_MS, () => this.isOpen && this.showsPictures && this.openVideo());
  }

  /** @param {string} text */
  heard(text) {
    this.expectWord(this.showsPictures ? SILENCE_MS : IDLE_SILENCE_MS);
    this.retryMs = FIRST_RETRY_MS;
    const words = parseWords(text);
    this.learn(words.nonce);
    if (words.type === 'pong') this.notePong(words.client_ms, words.server_ms);
    else this.emit('words', words);
    const isDue = words.type === 'state' && words.frame && words.frame !== this.frame && this.showsPictures;
    if (isDue && !('picture' in this.timers)) this.after('picture', PICTURE_MS, () => this.isOpen && this.openVideo());
  }

  ping() {
    this.send(encodePing(this.env.nowMs()));
    this.after('ping', PING_EVERY_MS, () => this.ping());
  }

  /** @param {number} clientMs @param {number} serverMs */
  notePong(clientMs, serverMs) {
    const nowMs = this.env.nowMs();
    this.samples.push({ rttMs: nowMs - clientMs, offsetMs: serverMs - (clientMs + nowMs) / 2 });
    if (this.samples.length > CLOCK_SAMPLES) this.samples.shift();
  }

  lose() {
    this.dropSockets();
    this.cancel('ping');
    this.cancel('silence');
    this.dispatchEvent(new Event('lost'));
    // A hidden tab does not connect again. A robot has few slots per person, so many tabs would evict each other.
    this.after('retry', this.retryMs, () => this.env.isHidden?.() || this.connect());
    this.retryMs = Math.min(this.retryMs * 2, LAST_RETRY_MS);
  }

  dropSockets() {
    this.dropVideo();
    const { drive } = this;
    this.drive = null;
    if (!drive) return;
    // Stop using the socket now, because it takes long to close on a silent network.
    drive.onopen = drive.onmessage = drive.onclose = drive.onerror = null;
    drive.close();
  }

  /** @param {number} ms */
  expectWord(ms) {
    this.after('silence', ms, () => this.lose());
  }

  /** @param {string} name @param {number} ms @param {() => void} act */
  after(name, ms, act) {
    this.cancel(name);
    this.timers[name] = this.env.setTimeout(act, ms);
  }

  /** @param {string} name */
  cancel(name) {
    if (name in this.timers) this.env.clearTimeout(this.timers[name]);
    delete this.timers[name];
  }

  /** @param {string} type @param {unknown} detail */
  emit(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }
}
