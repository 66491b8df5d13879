// Keeps the mode that a person has tapped, until the robot is in that mode.
//
// A request to start must prove that it is fresh (docs/reference/protocol.md, "Freshness").
// Right after connecting, and after a pause, the page may have no proof, or only one that is too old.
// The page then waits for the next picture and sends the request with its nonce, if the tap is recent.
// Therefore nobody has to tap twice, and the robot does not start when the person no longer expects it.

import { encodeMode } from './protocol.js';

/** Maximum age of a tap whose request is sent or repeated, in milliseconds. */
export const YOUNG_MS = 1000;
const NOT_PROVEN = ['stale', 'no_picture', 'unknown_frame'];

/** @typedef {import('./protocol.js').Mode} Mode */

/** The event `failed` reports that there was no proof of freshness in time. */
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
    /** @type {number | undefined} */
    this.stopNumber = undefined;
    /** @type {{mode: Mode, tappedMs: number, seq: number | null, nonce: number | null} | null} */
    this.tap = null;
  }

  /** @param {Mode} mode */
  ask(mode) {
    this.tap = null;
    if (mode === 'stopped') { // a request to stop needs no proof, so send it now
      this.connection.send(encodeMode(mode, this.connection.nextSeq(), this.lookingAt()));
      return;
    }
    this.tap = { mode, tappedMs: this.nowMs(), seq: null, nonce: null };
    this.go();
  }

  /** Forget the tap after a stop, a change of pilot, or a lost link. */
  forget() {
    this.tap = null;
  }

  /** Send the request if there is a proof of freshness. Called whenever there may be a proof. */
  go() {
    const { tap } = this;
    if (!tap) return;
    const isYoung = this.nowMs() - tap.tappedMs <= YOUNG_MS;
    if (tap.seq !== null) { // the request is under way, and the state will show its result
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

  /** Called when the robot has refused a message. @param {{code: string, seq?: number}} error */
  refuse({ code, seq }) {
    if (!this.tap || seq === undefined || seq !== this.tap.seq) return;
    if (!NOT_PROVEN.includes(code)) this.tap = null;
    else {
      this.tap.seq = null;
      this.go();
    }
  }

  /** Update the tap by a state message. A STOP since the last state, even if it is already released, makes the tap invalid. @param {{mode: Mode, you_are_pilot: boolean, emergency: boolean, stop_number?: number}} robot */
  follow(robot) {
    const isNewStop = this.stopNumber !== undefined && this.stopNumber !== robot.stop_number;
    this.stopNumber = robot.stop_number;
    if (robot.mode === this.tap?.mode || robot.emergency || isNewStop || !robot.you_are_pilot) this.tap = null;
    else this.go();
  }
}
