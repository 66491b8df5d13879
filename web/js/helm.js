// Sends the move that is held on any input device: on every change, and every 100 ms as a heartbeat.
//
// The heartbeat runs on the page's main thread on purpose: a page that hangs falls silent, and the robot stops.

import { moveOf, reachOf } from './points.js';
import { encodeDrive } from './protocol.js';
import { Start } from './start.js';

export const HEARTBEAT_MS = 100;
const EARLY_MS = 15;
/** Minimum time between two commands while a stick moves; its release is sent immediately. */
const STEERED_MS = 50;
const IDLE_BEATS = 5; // an idle page sends only every fifth heartbeat, which is enough to renew its lease

/** @typedef {import('./protocol.js').Mode} Mode */
/** @typedef {import('./points.js').Point} Point */
/** @typedef {{move: string | null, point: Point | null}} Hold  move is null if a thumb touches a stick without pushing it */

/** Events: `held` when the held move changes, `freed` when everything was released and must be pressed again, `refused` when a move is pressed while the robot is stopped or another client has the wheel. */
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
    /** True if the robot accepts proportional steering, and its pilot has chosen it. */
    this.takesPoints = false;
    this.hasStick = false;
    this.isSteered = false;
    this.hasWheel = false;
    /** @type {Mode} */
    this.mode = 'stopped';
    /** True while no picture is shown. Without a picture no move can be held, and heartbeats only renew the lease. */
    this.isIdle = false;
    this.beats = 0;
    this.beatMs = -HEARTBEAT_MS;
    /** Reads the inputs that send no events. @type {() => void} */
    this.read = () => {};
    /** Smoothed delay of heartbeats on this phone. */
    this.lateMs = 0;
  }

  /** The hold that counts: the newest hold of a move on any input device. @returns {Hold} */
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

  /** True if the robot may be moving. The value is also true right after a request to start, and after the link was lost. */
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

  /** Called when a stick is grasped, before it is pushed. @param {string} source */
  grasp(source) {
    if (this.mayMove) this.holds.set(source, { move: null, point: null });
    else this.dispatchEvent(new Event('refused'));
  }

  /** Set the point to which a stick is pushed. If everything was released since the stick was grasped, it must be grasped again. @param {string} source @param {Point | null} point */
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

  /** Send a heartbeat if one is due. A timer and other events call this method, because the timers of a slow phone are late. @param {number} nowMs */
  beatIfDue(nowMs) {
    this.read();
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

  /** Choose a mode. A held input does not count in the new mode until it is released and pressed again. @param {Mode} mode */
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

  /** Called when the link is lost, and with it the wheel. */
  lose() {
    this.hasWheel = false;
    this.start.forget();
    this.releaseAll();
  }
}
