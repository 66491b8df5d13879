// Actions of the user, and messages of the robot.

import { STOP_MS, ask, askToStop, inOrder } from './api.js';
import { Helm } from './helm.js';
import { hintNow } from './hints.js';
import { t } from './i18n.js';
import { declare } from './moves.js';

const AGREEMENT_EVERY = 5; // lessons between two points of the curve
const CURVE_POINTS = 160;
const NOTICE_MS = 3500;
const TOAST_MS = 8000;
const HINT_MS = 20_000;
const SLOW_PHONE_MS = 15; // heartbeats so late, as a rule, are those of a slow phone
const SLOW_STATE_MS = 300;
/** @type {Record<string, string>} events that are a sentence */
const TOLD = { model_not_saved: 'not_saved', set_aside: 'set_aside', put_back: 'put_back', nothing_kept: 'nothing_kept', kept_again: 'kept_again', recording_off: 'recording_off', check_battery: 'check_battery' };
const SHOWING = ['drive', 'gallery', 'why']; // screens with the robot's picture

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
    /** Another for each model, undo and visit: their images bear the same numbers. */
    this.era = Math.round(performance.timeOrigin);
    /** @type {ReturnType<typeof setTimeout> | undefined} */
    this.noticeTimer = undefined;
    /** @type {Promise<unknown>} the last stop by request */
    this.stopping = Promise.resolve();
    /** A STOP was pressed, and nothing has shown yet that the robot obeyed. */
    this.isStopping = false;
    this.isReleasing = false;
    /** @type {ReturnType<typeof setTimeout> | undefined} */
    this.toastTimer = undefined;
    /** @type {ReturnType<typeof setTimeout> | undefined} asks elsewhere for a stop that is not answered */
    this.stopTimer = undefined;
    this.shownGist = '';
    /** Which devices body and camera are, where they were found by searching; by the stop that their fault causes.
     * @type {Record<string, string | undefined>} */
    this.devices = {};
    this.drawingMs = 0;
    /** @type {number | null} */
    this.drawnAgeMs = null;
    this.shownMs = -Infinity;
    const { helm } = this;
    /** @type {Record<string, (words: any) => void>} */
    this.hearers = { hello: (w) => this.greet(w), state: (w) => this.follow(w), event: (w) => this.note(w), error: (w) => helm.start.refuse(w) };
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

  /** A picture is on the screen. @param {import('./painter.js').Shown} shown */
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
    if (this.isStopping) this.connection.say('stop'); // a request may wait behind what the dead link still holds
    declare(hello.declared_moves ?? []);
    const [before, device] = [this.devices.drive_fault, hello.device];
    // After a restart it may be another one of the same name.
    if (device && device !== before) this.toast(t(before ? 'device_other' : 'device_now', { device, before: before ?? '' }));
    this.devices = { drive_fault: device ?? before, camera_fault: hello.camera_device };
    this.beginEra();
    this.store.set({ isWatching: false, role: hello.role, robotName: hello.robot, moves: hello.moves, takesPoints: hello.takes_points === true });
    this.followPreferences();
  }

  /** Whether this pilot steers this robot by a thumb stick. */
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
      link: 'open', // not before: what is known from an earlier link may be over
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
    // After the state is shown: the proposal in it may still be that of the model before.
    if (before && (robot.lessons < before.lessons || (robot.mode === 'stopped' && robot.lessons !== before.lessons))) this.beginEra();
    this.followHint(robot);
    this.drawCurve(robot);
    this.wakeLock.want(robot.mode !== 'stopped');
  }

  /** What was learned is another than before, and not by teaching. */
  beginEra() {
    this.era += 1;
    this.refreshCurve();
  }

  /** Where a learned image is had; the browser keeps it as long as its stamp is the same. @param {number} node @param {string} stamp */
  imageOf(node, stamp) {
    return `api/gallery/${node}.png?v=${this.era}.${stamp}`;
  }

  /** A slow phone shows fewer states, so that heartbeats and fingers get their time. @param {RobotState} robot */
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

  /** Begin the curve with what was taught before this page came. */
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

  /** Show a notice on any screen, with one action. @param {string} text @param {{label: string, act: () => void} | null} [step] @param {number} [ms]  Infinity: until the next one */
  toast(text, step = null, ms = TOAST_MS) {
    clearTimeout(this.toastTimer);
    this.store.set({ toast: { text, step } });
    if (ms < Infinity) this.toastTimer = setTimeout(() => this.store.set({ toast: null }), ms);
  }

  /** Say that what was just done is not on the disk, after what is said of it already. */
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

  /** The emergency stop. Anybody may, pilot or not. */
  stop() {
    this.helm.start.forget();
    this.helm.releaseAll();
    this.isStopping = true;
    this.isReleasing = false;
    if (!this.connection.say('stop')) this.stopElsewhere();
    else this.stopTimer ??= setTimeout(() => this.stopElsewhere(), STOP_MS);
    if (this.preferences.vibrate) navigator.vibrate?.([60, 40, 60]);
  }

  /** A state shows the stop: no other way is needed, and who releases it is not stopped again. */
  endStop() {
    this.isStopping = false;
    clearTimeout(this.stopTimer);
    this.stopTimer = undefined;
  }

  /** The websocket is away or slow: stop by requests of its own, until one reaches the robot. */
  stopElsewhere() {
    clearTimeout(this.stopTimer);
    this.stopTimer = undefined;
    this.stopping = askToStop(() => this.isStopping).then((isHeard) => isHeard && this.endStop());
  }

  /** Release the emergency stop once no request of ours is left that would latch it again, and if no STOP came meanwhile. */
  async release() {
    this.endStop();
    this.isReleasing = true;
    await this.stopping;
    if (this.isReleasing) this.connection.say('release');
    this.isReleasing = false;
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
    if (step.startsWith('#')) { // a screen
      location.hash = step;
      return;
    }
    if (step === 'release') {
      this.release();
      return;
    }
    this.connection.say(/** @type {'take' | 'yield'} */ (step));
  }

  /** Show the hint about what is happening now; one whose moment is over is not shown again. @param {RobotState} robot */
  followHint(robot) {
    const { hint } = this.store.state;
    const now = hintNow(robot, this.preferences.hintsShown);
    if (hint && hint !== now) this.endHint();
    else if (hint !== now) {
      this.store.set({ hint: now });
      // Who drives has no finger to put it away; what helps most now must come to be seen again.
      if (robot.mode !== 'stopped') setTimeout(() => this.store.state.hint === now && this.endHint(), HINT_MS);
    }
  }

  endHint() {
    const { hint } = this.store.state;
    if (hint) this.preferences.set('hintsShown', [...this.preferences.hintsShown, hint]);
    this.store.set({ hint: null });
  }

  /** The video is fetched only where it is shown, and only a page that shows it may drive. */
  followScreen() {
    const shows = SHOWING.includes(this.store.state.screen) && !document.hidden;
    if (!shows && !document.hidden) this.hide('elsewhere');
    this.connection.showPictures(shows);
    this.helm.isIdle = !shows;
    if (!shows) this.looking = null;
  }

  /** The picture goes out of sight: nobody supervises the robot any more. @param {'hidden' | 'elsewhere'} why */
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
