// The held move from any input device, sent on every change and every 100 ms.
//
// The heartbeat runs on the page's main thread on purpose: a page that hangs falls silent, and the robot stops.

import { moveOf, reachOf } from './points.js';
import { encodeDrive } from './protocol.js';
import { Start } from './start.js';

export const HEARTBEAT_MS = 100;
const EARLY_MS = 15;
/** Minimum time between two commands of a moving stick; a release is sent at once. */
const STEERED_MS = 50;
const IDLE_BEATS = 5; // an idle page sends every fifth heartbeat: enough to renew its lease

/** @typedef {import('./protocol.js').Mode} Mode */
/** @typedef {import('./points.js').Point} Point */
/** @typedef {{move: string | null, point: Point | null}} Hold  move is null if a thumb rests on its stick */

/** Events: `held` when the held move changes, `freed` when everything was released and must be pressed again, `refused` when a move is requested from a standing robot. */
export class Helm extends EventTarget {
  /**
   * @param {{send: (text: string) => boolean, nextSeq: () => number}} connection
   * @param {() => import('./protocol.js').Sight} lookingAt
   */
  constructor(connection, lookingAt) {
    super();
    this.connection = connection;
    this.lookingAt = lookingAt;
    this.start = new Start(connection, lookingAt);
    /** @type {Map<string, Hold>} the hold of each finger, key or stick; the newest last */
    this.holds = new Map();
    /** @type {readonly string[]} */
    this.moves = [];
    /** True if the robot accepts degrees and its pilot wants a thumb stick and ramping keys. */
    this.takesPoints = false;
    this.hasStick = false;
    this.isSteered = false;
    this.hasWheel = false;
    /** @type {Mode} */
    this.mode = 'stopped';
    /** True while no picture is shown. No move can be held then, and heartbeats only renew the lease. */
    this.isIdle = false;
    this.beats = 0;
    this.beatMs = -HEARTBEAT_MS;
    /** Smoothed delay of heartbeats on this phone. */
    this.lateMs = 0;
  }

  /** The hold that counts: the newest with a move. @returns {Hold} */
  get newest() {
    return [...this.holds.values()].filter(({ move }) => move).pop() ?? { move: null, point: null };
  }

  get held() {
    return this.newest.move;
  }

  get reach() {
    return reachOf(this.moves);
  }

  get mayMove() {
    return this.hasWheel && this.mode !== 'stopped';
  }

  /** True if the robot may be moving, also right after a start request or a lost link. */
  get mayBeMoving() {
    return this.mode !== 'stopped' || this.start.tap !== null;
  }

  /** @param {string} source such as `key ArrowUp` @param {string} move */
  press(source, move) {
    if (!this.moves.includes(move)) return;
    if (!this.mayMove) {
      this.dispatchEvent(new Event('refused'));
      return;
    }
    this.change(() => {
      if (this.holds.get(source)?.move === move) return;
      this.holds.delete(source);
      this.holds.set(source, { move, point: null });
    });
  }

  /** Take hold of a stick, at rest. @param {string} source */
  grasp(source) {
    if (this.mayMove) this.holds.set(source, { move: null, point: null });
    else this.dispatchEvent(new Event('refused'));
  }

  /** Turn a stick; a stick that was released meanwhile must be grasped again. @param {string} source @param {Point | null} point */
  steer(source, point) {
    const move = point && moveOf(point, this.moves);
    this.change(() => this.holds.has(source) && this.holds.set(source, { move, point: move ? point : null }), true);
  }

  /** @param {string} source */
  release(source) {
    this.change(() => this.holds.delete(source));
  }

  releaseAll() {
    this.change(() => this.holds.clear());
    this.dispatchEvent(new Event('freed'));
  }

  /** @param {() => void} act @param {boolean} [isSteered] */
  change(act, isSteered = false) {
    const before = this.newest;
    act();
    const now = this.newest;
    if (now.move === before.move && now.point === before.point) return;
    this.isSteered = isSteered;
    if (isSteered) this.beatIfDue(performance.now());
    else this.beat();
    this.dispatchEvent(new Event('held'));
  }

  /** Send a heartbeat if one is due. It is called by a timer and by other work, because a slow phone's timers are late. @param {number} nowMs */
  beatIfDue(nowMs) {
    const sinceMs = nowMs - this.beatMs;
    if (sinceMs < (this.isSteered ? STEERED_MS : HEARTBEAT_MS) - EARLY_MS) return;
    if (this.beatMs > 0 && !this.isSteered) this.lateMs += (Math.max(0, sinceMs - HEARTBEAT_MS) - this.lateMs) / 8;
    this.beatMs = nowMs;
    this.beat();
  }

  /** Send what is held: on every change, and as a heartbeat. */
  beat() {
    this.beats += 1;
    if (!this.hasWheel || (this.isIdle && this.beats % IDLE_BEATS)) return;
    this.isSteered = false;
    const { move: held, point } = this.newest;
    this.connection.send(encodeDrive({ held, ...point, seq: this.connection.nextSeq(), ...this.lookingAt() }));
  }

  /** Choose a mode; earlier holds do not count in the new mode. @param {Mode} mode */
  choose(mode) {
    this.releaseAll();
    this.start.ask(mode);
  }

  /** Apply a state message. @param {{mode: Mode, you_are_pilot: boolean, emergency: boolean}} robot @param {readonly string[]} moves */
  follow(robot, moves) {
    this.moves = moves;
    this.hasWheel = robot.you_are_pilot;
    this.mode = robot.mode;
    if (!this.mayMove) this.releaseAll();
    this.start.follow(robot);
  }

  /** The link is lost, and with it the wheel. */
  lose() {
    this.hasWheel = false;
    this.start.forget();
    this.releaseAll();
  }
}
