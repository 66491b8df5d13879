// Handles the actions of the person and the messages of the robot.

import { STOP_MS, ask, askToStop, inOrder } from './api.js';
import { Helm } from './helm.js';
import { hintNow } from './hints.js';
import { t } from './i18n.js';
import { declare } from './moves.js';
import { encodeRelease } from './protocol.js';

const AGREEMENT_EVERY = 5; // number of examples between two points of the curve of agreement
const CURVE_POINTS = 160;
const NOTICE_MS = 3500;
const TOAST_MS = 8000;
const HINT_MS = 20_000;
const SLOW_PHONE_MS = 15; // average delay of heartbeats above which a phone counts as slow
const SLOW_STATE_MS = 300;
/** @type {Record<string, string>} events that are shown as a sentence */
const TOLD = { model_not_saved: 'not_saved', set_aside: 'set_aside', put_back: 'put_back', unfit: 'unfit', nothing_kept: 'nothing_kept', kept_again: 'kept_again', recording_off: 'recording_off', check_battery: 'check_battery' };
const SHOWING = ['drive', 'gallery', 'why']; // the screens that show the robot's picture

/** @typedef {import('./protocol.js').Mode} Mode */
/** @typedef {import('./protocol.js').RobotState} RobotState */

export class Page {
  /**
   * @param {{store: import('./store.js').Store, connection: import('./connection.js').Connection,
   *   preferences: import('./device.js').Preferences, wakeLock: import('./device.js').WakeLock}} parts
   */
  constructor({ store, connection, preferences, wakeLock }) {
    this.store = store;
    this.connection = connection;
    this.preferences = preferences;
    this.wakeLock = wakeLock;
    /** @type {import('./painter.js').Shown | null} the picture on the screen */
    this.looking = null;
    this.helm = new Helm(connection, () => this.lookingAt());
    this.curveLessons = 0;
    this.curveInOrder = inOrder();
    /** Changes with each model, undo and visit, because the same image number then means another image. */
    this.era = Math.round(performance.timeOrigin);
    /** @type {ReturnType<typeof setTimeout> | undefined} */
    this.noticeTimer = undefined;
    /** @type {Promise<unknown>} the last stop by request */
    this.stopping = Promise.resolve();
    /** True after a STOP until the robot confirms it. */
    this.isStopping = false;
    this.isReleasing = false;
    /** @type {ReturnType<typeof setTimeout> | undefined} */
    this.toastTimer = undefined;
    /** @type {ReturnType<typeof setTimeout> | undefined} the timer that sends an unconfirmed stop another way */
    this.stopTimer = undefined;
    this.shownGist = '';
    /** The devices of body and camera that a search has found, by the stop reason that their failure causes.
     * @type {Record<string, string | undefined>} */
    this.devices = {};
    this.drawingMs = 0;
    /** @type {number | null} */
    this.drawnAgeMs = null;
    this.shownMs = -Infinity;
    const { helm } = this;
    /** @type {Record<string, (words: any) => void>} */
    this.hearers = { hello: (w) => this.greet(w), state: (w) => this.follow(w), event: (w) => this.note(w), error: (w) => this.hearRefusal(w) };
    this.listen();
  }

  listen() {
    const { connection, helm, store } = this;
    connection.addEventListener('words', (event) => {
      const words = /** @type {CustomEvent} */ (event).detail;
      helm.beatIfDue(performance.now());
      this.hearers[words.type]?.(words);
    });
    connection.addEventListener('lost', () => {
      helm.lose();
      this.looking = null;
      this.isReleasing = false;
      store.set({ link: 'lost', held: null, wheelAsked: false, wheelWaiting: false });
    });
    helm.addEventListener('held', () => store.set({ held: helm.held }));
    helm.start.addEventListener('failed', () => this.mention('start_stale'));
    helm.addEventListener('refused', () => helm.hasWheel && this.mention('choose_first'));
    addEventListener('blur', () => helm.releaseAll());
    addEventListener('pagehide', () => this.hide('hidden'));
    addEventListener('pageshow', (event) => event.persisted && connection.reconnect());
    document.addEventListener('visibilitychange', () => (document.hidden ? this.hide('hidden') : this.followScreen()));
    document.addEventListener('visibilitychange', () => document.hidden || connection.seek());
    store.watch(['screen'], () => this.followScreen());
  }

  get lastAgeMs() {
    return this.looking ? this.connection.ageMs(this.looking.capturedMs) : null;
  }

  /** Called when a picture is on the screen. @param {import('./painter.js').Shown} shown */
  look(shown) {
    this.looking = shown;
    this.helm.start.go();
    const drawingMs = performance.now() - shown.arrivedMs;
    this.drawingMs += (drawingMs - this.drawingMs) / 8;
    const ageMs = this.lastAgeMs;
    if (ageMs !== null) this.drawnAgeMs = this.drawnAgeMs === null ? ageMs : this.drawnAgeMs + (ageMs - this.drawnAgeMs) / 8;
  }

  lookingAt() {
    const ageMs = this.lastAgeMs;
    return {
      frame: this.looking?.frame ?? null,
      nonce: this.connection.nonce,
      frameAgeMs: ageMs === null ? null : Math.round(ageMs),
      phoneMs: this.looking && Math.max(0, Math.round(performance.now() - this.looking.arrivedMs)),
    };
  }

  /** @param {{role: 'pilot' | 'viewer', robot: string, moves: string[], declared_moves?: import('./moves.js').Move[], takes_points?: boolean, device?: string, camera_device?: string}} hello */
  greet(hello) {
    if (this.isStopping) this.connection.say('stop'); // send it on the new link, too, because the request may wait behind data of the dead link
    declare(hello.declared_moves ?? []);
    const [before, device] = [this.devices.drive_fault, hello.device];
    // Say which device the robot uses, because after a restart the robot may have found another device of the same kind.
    if (device && device !== before) this.toast(t(before ? 'device_other' : 'device_now', { device, before: before ?? '' }));
    this.devices = { drive_fault: device ?? before, camera_fault: hello.camera_device };
    this.beginEra();
    this.store.set({ isWatching: false, role: hello.role, robotName: hello.robot, moves: hello.moves, takesPoints: hello.takes_points === true });
    this.followPreferences();
  }

  /** Use proportional steering if the robot accepts it and the person has chosen it on this device. */
  followPreferences() {
    const { takesPoints, robotName } = this.store.state;
    const hasStick = takesPoints && this.preferences.stickFor(robotName);
    this.helm.releaseAll();
    Object.assign(this.helm, { takesPoints, hasStick });
    this.store.set({ hasStick });
  }

  /** @param {RobotState} robot */
  follow(robot) {
    const { store, helm } = this;
    const moves = Object.keys(robot.taught);
    helm.follow(robot, moves);
    if (robot.emergency) this.endStop();
    if (!this.isWorthShowing(robot) && store.state.link === 'open') return;
    const isSame = String(moves) === String(store.state.moves);
    const before = store.state.robot;
    const device = before?.fault && !robot.fault && this.devices[before.stop_reason ?? ''];
    if (device) this.toast(t('device_back', { device }));
    const hasGotIt = before && !before.you_are_pilot && before.pilot !== null && robot.you_are_pilot;
    store.set({
      link: 'open', // only now, because a state from an earlier link may be outdated
      robot,
      pictureAgeMs: this.lastAgeMs,
      drawnAgeMs: this.drawnAgeMs,
      drawingMs: this.drawingMs,
      delayMs: this.connection.delayMs,
      frame: this.looking?.frame ?? null,
      held: helm.held,
      ...(hasGotIt ? { localStop: 'wheel' } : {}),
      ...(isSame ? {} : { moves }),
      wheelAsked: robot.you_are_pilot && robot.wheel_asked === true,
      ...(robot.you_are_pilot ? { wheelWaiting: false } : {}),
    });
    // Do this after the state is shown, because its prediction may still be that of the previous model.
    if (before && (robot.lessons < before.lessons || (robot.mode === 'stopped' && robot.lessons !== before.lessons))) this.beginEra();
    this.followHint(robot);
    this.drawCurve(robot);
    this.wakeLock.want(robot.mode !== 'stopped');
  }

  /** Note that the learned images were changed by something other than teaching. */
  beginEra() {
    this.era += 1;
    this.refreshCurve();
  }

  /** The address of a learned image; the browser caches it while its stamp is the same. @param {number} node @param {string} stamp */
  imageOf(node, stamp) {
    return `api/gallery/${node}.png?v=${this.era}.${stamp}`;
  }

  /** True if a state is to be shown. A slow phone shows fewer states, to leave time for heartbeats and touches. @param {RobotState} robot */
  isWorthShowing(robot) {
    const nowMs = performance.now();
    const { mode, driven_by, action, stop_reason, emergency, you_are_pilot, fault, link } = robot;
    const gist = JSON.stringify([mode, driven_by, action, stop_reason, emergency, you_are_pilot, fault, link]);
    const isSlow = this.helm.lateMs > SLOW_PHONE_MS;
    if (isSlow && gist === this.shownGist && nowMs - this.shownMs < SLOW_STATE_MS) return false;
    this.shownGist = gist;
    this.shownMs = nowMs;
    return true;
  }

  /** Begin the curve of agreement with the examples that were taught before this page was opened. */
  async refreshCurve() {
    const teaching = await this.curveInOrder(ask('GET', 'api/teaching'));
    if (!teaching) return;
    this.curveLessons = teaching.lessons;
    const shares = teaching.history.map((/** @type {[number, number]} */ [, share]) => share);
    this.store.set({ agreement: shares.slice(-CURVE_POINTS) });
  }

  /** @param {RobotState} robot */
  drawCurve({ agreement, lessons }) {
    if (lessons < this.curveLessons) {
      this.store.set({ agreement: [] });
      this.curveLessons = lessons;
    }
    if (agreement === null || lessons - this.curveLessons < AGREEMENT_EVERY) return;
    this.curveLessons = lessons;
    this.store.set({ agreement: [...this.store.state.agreement, agreement].slice(-CURVE_POINTS) });
  }

  /** @param {{name: string, detail?: string, robot?: string}} event */
  note(event) {
    if (event.name in TOLD) this.toast(t(TOLD[event.name], { detail: event.detail ?? '' }));
    if (event.name === 'renamed') {
      this.preferences.chooseStick(event.robot ?? '', this.store.state.hasStick);
      this.store.set({ robotName: event.robot });
    }
    if (event.name === 'wheel_waiting') this.store.set({ wheelWaiting: true });
  }

  /** Show a notice for a moment. @param {string} notice */
  mention(notice) {
    clearTimeout(this.noticeTimer);
    this.store.set({ notice });
    this.noticeTimer = setTimeout(() => this.store.set({ notice: null }), NOTICE_MS);
  }

  /** Show a notice on any screen, with one action. @param {string} text @param {{label: string, act: () => void} | null} [step] @param {number} [ms]  Infinity: until the next toast */
  toast(text, step = null, ms = TOAST_MS) {
    clearTimeout(this.toastTimer);
    this.store.set({ toast: { text, step } });
    if (ms < Infinity) this.toastTimer = setTimeout(() => this.store.set({ toast: null }), ms);
  }

  /** Report that the last change was not saved, after the message about the change. */
  tellNotKept() {
    const { toast } = this.store.state;
    const text = t('done_not_kept');
    if (!toast?.text.includes(text)) this.toast([toast?.text, text].filter(Boolean).join(' '), toast?.step ?? null);
  }

  // What a person does ---------------------------------------------------------------------------

  /** True while the pad is on the screen, so that keys and sticks may drive. */
  isDriving() {
    return this.store.state.screen === 'drive';
  }

  /** @param {Mode} mode */
  choose(mode) {
    this.store.set({ localStop: null, notice: null });
    this.helm.choose(mode);
  }

  /** The emergency stop, which anybody may request, pilot or not. */
  stop() {
    this.helm.start.forget();
    this.helm.releaseAll();
    this.isStopping = true;
    this.isReleasing = false;
    if (!this.connection.say('stop')) this.stopElsewhere();
    else this.stopTimer ??= setTimeout(() => this.stopElsewhere(), STOP_MS);
    if (this.preferences.vibrate) navigator.vibrate?.([60, 40, 60]);
  }

  /** Called when a state confirms the stop: end the requests, so that none of them stops the robot after a release. */
  endStop() {
    this.isStopping = false;
    clearTimeout(this.stopTimer);
    this.stopTimer = undefined;
  }

  /** Send STOP by HTTP requests until one reaches the robot, because the websocket is lost or slow. */
  stopElsewhere() {
    clearTimeout(this.stopTimer);
    this.stopTimer = undefined;
    this.stopping = askToStop(() => this.isStopping).then((number) => {
      if (number !== null) this.endStop();
      return number;
    });
  }

  /** Release the emergency stop that is shown, unless STOP was pressed in the meantime. The release waits until no request of this page can latch the stop again. */
  async release() {
    const shown = this.store.state.robot?.stop_number ?? 0;
    this.endStop();
    this.isReleasing = true;
    const own = await this.stopping;
    // The robot may have counted our own request as the next STOP, although it repeats the STOP that is shown.
    if (this.isReleasing) this.connection.send(encodeRelease(own === shown + 1 ? own : shown));
    this.isReleasing = false;
  }

  /** Called when the robot has refused a message. @param {{code: string, seq?: number}} error */
  hearRefusal(error) {
    this.helm.start.refuse(error);
    if (error.code === 'newer_stop') this.toast(t('newer_stop'));
  }

  /** Take the step that a notice offers. @param {string} step */
  take(step) {
    if (step === 'hint') {
      this.endHint();
      return;
    }
    if (step === 'watch') {
      this.store.set({ isWatching: true });
      return;
    }
    if (step.startsWith('#')) { // the step opens a screen
      location.hash = step;
      return;
    }
    if (step === 'release') {
      this.release();
      return;
    }
    this.connection.say(/** @type {'take' | 'yield'} */ (step));
  }

  /** Show the hint for the current moment; a hint whose moment is over is not shown again. @param {RobotState} robot */
  followHint(robot) {
    const { hint } = this.store.state;
    const now = hintNow(robot, this.preferences.hintsShown);
    if (hint && hint !== now) this.endHint();
    else if (hint !== now) {
      this.store.set({ hint: now });
      // While driving, no finger is free to close the hint, so it closes itself and makes room for the advice.
      if (robot.mode !== 'stopped') setTimeout(() => this.store.state.hint === now && this.endHint(), HINT_MS);
    }
  }

  endHint() {
    const { hint } = this.store.state;
    if (hint) this.preferences.set('hintsShown', [...this.preferences.hintsShown, hint]);
    this.store.set({ hint: null });
  }

  /** Request the video only on screens that show it, and drive only on these screens. */
  followScreen() {
    const shows = SHOWING.includes(this.store.state.screen) && !document.hidden;
    if (!shows && !document.hidden) this.hide('elsewhere');
    this.connection.showPictures(shows);
    this.helm.isIdle = !shows;
    if (!shows) this.looking = null;
  }

  /** Stop the robot, because the picture is no longer visible, so nobody supervises it. @param {'hidden' | 'elsewhere'} why */
  hide(why) {
    const { robot } = this.store.state;
    this.helm.releaseAll();
    if (robot?.you_are_pilot && (robot.mode !== 'stopped' || this.helm.start.tap)) {
      this.helm.choose('stopped');
      this.store.set({ localStop: why });
    }
    if (document.hidden) this.followScreen();
  }
}
