// The websocket of a phone that is the robot's camera.
// The phone sends only the newest picture, and at most two pictures before the robot acknowledges one of them.
// This module does not use the document, and tests replace the browser's WebSocket.

const HEADER_BYTES = 16;
const EYE_FRAME = 3;
const COVERED = 1;
const WINDOW = 2; // number of pictures in flight; with more, pictures would only be older when they arrive
const SILENCE_MS = 1500;
const RETRY_MS = 500;

/** @param {number} seq @param {number} takenMs @param {boolean} covered @param {Uint8Array} jpeg */
export function encodeEyeFrame(seq, takenMs, covered, jpeg) {
  const message = new Uint8Array(HEADER_BYTES + jpeg.length);
  const view = new DataView(message.buffer);
  view.setUint8(0, EYE_FRAME);
  view.setUint8(1, covered ? COVERED : 0);
  view.setUint32(4, seq, true);
  view.setFloat64(8, takenMs, true);
  message.set(jpeg, HEADER_BYTES);
  return message;
}

/** Events: `hello`, `state`, `closed` (`detail`: the code), `lost`. */
export class EyeLink extends EventTarget {
  /** @param {string} url @param {Partial<import('../js/connection.js').Environment>} [environment] */
  constructor(url, environment = {}) {
    super();
    this.url = url;
    /** @type {import('../js/connection.js').Environment} */
    this.env = {
      WebSocket: globalThis.WebSocket,
      nowMs: () => performance.now(),
      setTimeout: (f, ms) => /** @type {any} */ (globalThis.setTimeout(f, ms)),
      clearTimeout: (id) => globalThis.clearTimeout(id),
      ...environment,
    };
    /** @type {WebSocket | null} */
    this.socket = null;
    this.seq = 0;
    this.acknowledged = 0;
    this.isGreeted = false;
    /** True after a STOP until the robot confirms it. */
    this.owesStop = false;
    /** @type {number | undefined} */
    this.timer = undefined;
  }

  /** True if another picture may be sent now. */
  get hasCredit() {
    return this.isGreeted && this.seq - this.acknowledged < WINDOW;
  }

  connect() {
    this.drop();
    this.seq = this.acknowledged = 0;
    const socket = (this.socket = new this.env.WebSocket(this.url));
    socket.binaryType = 'arraybuffer';
    socket.onmessage = ({ data }) => this.heard(data);
    socket.onclose = ({ code }) => this.lose(code);
    this.expect(SILENCE_MS * 2);
  }

  /** @param {string | ArrayBuffer} data */
  heard(data) {
    this.expect(SILENCE_MS);
    if (typeof data !== 'string') {
      this.acknowledged = Math.max(this.acknowledged, new DataView(data).getUint32(4, true));
      return;
    }
    const words = JSON.parse(data);
    if (words.type === 'ping') this.say({ type: 'pong', server_ms: words.server_ms, eye_ms: this.env.nowMs() });
    if (words.type === 'hello') {
      this.isGreeted = true;
      if (this.owesStop) this.stop();
    }
    if (words.emergency) this.owesStop = false;
    this.dispatchEvent(new CustomEvent(words.type, { detail: words }));
  }

  /** Send a picture. If too many pictures are in flight, drop the picture and return false. @param {Uint8Array} jpeg @param {number} takenMs @param {boolean} covered */
  show(jpeg, takenMs, covered) {
    if (!this.hasCredit || this.socket?.readyState !== 1) return false;
    this.seq += 1;
    this.socket.send(encodeEyeFrame(this.seq, takenMs, covered, jpeg));
    return true;
  }

  /** Send STOP. If this connection is dead, the next connection sends the STOP again. */
  stop() {
    this.owesStop = true;
    this.say({ type: 'stop' });
  }

  /** @param {object} words */
  say(words) {
    if (this.socket?.readyState === 1) this.socket.send(JSON.stringify(words));
  }

  /** @param {number} [code] */
  lose(code) {
    this.drop();
    this.dispatchEvent(new CustomEvent(code && code >= 4000 ? 'closed' : 'lost', { detail: code }));
    if (!code || code < 4000) this.timer = this.env.setTimeout(() => this.connect(), RETRY_MS);
  }

  drop() {
    this.isGreeted = false;
    if (this.timer !== undefined) this.env.clearTimeout(this.timer);
    this.timer = undefined;
    if (this.socket) {
      this.socket.onmessage = this.socket.onclose = null;
      this.socket.close();
    }
    this.socket = null;
  }

  /** @param {number} ms */
  expect(ms) {
    if (this.timer !== undefined) this.env.clearTimeout(this.timer);
    this.timer = this.env.setTimeout(() => this.lose(), ms);
  }
}
