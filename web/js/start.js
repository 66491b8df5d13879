// A finger's request for a mode, from the tap until the robot is in it.
//
// A start proves that it is fresh (docs/reference/protocol.md, "Freshness"). Right after connecting, and
// after a pause, the page may have nothing to prove it with, or only what is too old by now. Then it
// waits for the next picture and asks with that, as long as the tap is young: nobody has to tap twice,
// and nothing starts that the person no longer expects.

import { encodeMode } from './protocol.js';

/** How old a tap may be when it is asked again. */
export const YOUNG_MS = 1000;
const NOT_PROVEN = ['stale', 'no_picture', 'unknown_frame'];

/** @typedef {import('./protocol.js').Mode} Mode */

/** Events: `failed`, when a request could not be proven while the tap was young. */
export class Start extends EventTarget {
  /**
   * @param {{send: (text: string) => boolean, nextSeq: () => number}} connection
   * @param {() => import('./protocol.js').Sight} lookingAt
   * @param {() => number} nowMs
   */
  constructor(connection, lookingAt, nowMs = () => performance.now()) {
    super();
    this.connection = connection;
    this.lookingAt = lookingAt;
    this.nowMs = nowMs;
    /** @type {{mode: Mode, tappedMs: number, seq: number | null, nonce: number | null} | null} */
    this.tap = null;
  }

  /** @param {Mode} mode */
  ask(mode) {
    this.tap = null;
    if (mode === 'stopped') { // needs no proof, and waits for nothing
      this.connection.send(encodeMode(mode, this.connection.nextSeq(), this.lookingAt()));
      return;
    }
    this.tap = { mode, tappedMs: this.nowMs(), seq: null, nonce: null };
    this.go();
  }

  /** Something else came between: a stop, another pilot, a lost link. */
  forget() {
    this.tap = null;
  }

  /** Ask if there is something to prove it with: called whenever there may be. */
  go() {
    const { tap } = this;
    if (!tap) return;
    const isYoung = this.nowMs() - tap.tappedMs <= YOUNG_MS;
    if (tap.seq !== null) { // under way: what became of it is seen in the state
      if (!isYoung) this.tap = null;
      return;
    }
    if (!isYoung) {
      this.tap = null;
      this.dispatchEvent(new Event('failed'));
      return;
    }
    const sight = this.lookingAt();
    if (!sight.frame || !sight.nonce || sight.nonce === tap.nonce) return;
    tap.seq = this.connection.nextSeq();
    tap.nonce = sight.nonce;
    this.connection.send(encodeMode(tap.mode, tap.seq, sight));
  }

  /** The robot refused a message. @param {{code: string, seq?: number}} error */
  refuse({ code, seq }) {
    if (!this.tap || seq === undefined || seq !== this.tap.seq) return;
    if (!NOT_PROVEN.includes(code)) this.tap = null;
    else {
      this.tap.seq = null;
      this.go();
    }
  }

  /** Apply a state message. @param {{mode: Mode, you_are_pilot: boolean, emergency: boolean}} robot */
  follow(robot) {
    if (robot.mode === this.tap?.mode || robot.emergency || !robot.you_are_pilot) this.tap = null;
    else this.go();
  }
}
