// The page of a phone that is the robot's camera: it uses the rear camera, keeps the screen on, and has a big STOP.

import { askToStop, askWhy, socketBase } from '../js/api.js';
import { WakeLock } from '../js/device.js';
import { EyeLink } from './eye-link.js';
import { Packer } from './eye-picture.js';
import { listenForStop } from '../js/inputs/stop-keys.js';
import { has, loadLanguage, t } from '../js/i18n.js';

const LATE_MS = 1000; // an older time stamp of a camera is ignored
const HAS_PICTURE = 2; // a video has a picture from this value of its `readyState` on

/** @template {Element} T @param {string} id @returns {T} */
const find = (id) => /** @type {T} */ (/** @type {unknown} */ (document.getElementById(id)));
const seen = /** @type {HTMLVideoElement} */ (find('seen'));
const said = /** @type {HTMLElement} */ (find('said'));
const figures = /** @type {HTMLElement} */ (find('figures'));
const begin = /** @type {HTMLButtonElement} */ (find('begin'));
const stop = /** @type {HTMLButtonElement} */ (find('stop'));

await loadLanguage([(code) => import(`./messages/${code}.js`)]);
document.title = t('eye.title');
begin.textContent = t('eye.begin');
stop.textContent = t('emergency_stop');

const link = new EyeLink(`${socketBase()}/ws/eye`);
const wakeLock = new WakeLock();
const worker = 'OffscreenCanvas' in window ? new Worker('eye/eye-worker.js', { type: 'module' }) : null;
const makePacker = () => new Packer((width, height) => Object.assign(document.createElement('canvas'), { width, height }));
let packer = worker ? null : makePacker();
let wanted = { width: 320, height: 240, rate_hz: 15 };
let dueMs = -Infinity;
let waiting = 0;
let isPacking = false;
let sent = 0;
worker?.addEventListener('error', () => {
  packer ??= makePacker(); // without a worker, the page encodes pictures itself
  isPacking = false;
}, { once: true });

/** @param {string} text @param {boolean} [isBad] */
function tell(text, isBad = false) {
  if (said.textContent !== text) said.textContent = text;
  said.dataset.level = isBad ? 'bad' : 'good';
}

async function open() {
  begin.hidden = true;
  if (!navigator.mediaDevices) return tell(t('eye.insecure'), true);
  try {
    const video = { facingMode: { ideal: 'environment' }, width: { ideal: 640 }, height: { ideal: 480 }, frameRate: { ideal: 30 } };
    seen.srcObject = await navigator.mediaDevices.getUserMedia({ video, audio: false });
    for (const track of seen.srcObject.getTracks()) track.onended = () => lose();
    await seen.play();
  } catch (error) {
    return lose(/** @type {{name?: string}} */ (error).name);
  }
  wakeLock.want(true);
  link.connect();
  next();
}

/** The message for each error name by which browsers report a camera that cannot be used. @type {Record<string, string>} */
const WHY = { NotFoundError: 'none', DevicesNotFoundError: 'none', OverconstrainedError: 'none', NotReadableError: 'in_use', TrackStartError: 'in_use', AbortError: 'in_use' };

/** Called if the camera is missing, not allowed, or used by another program: discard the last picture and say so. @param {string} [name]  of the browser's error */
function lose(name = '') {
  for (const track of /** @type {MediaStream | null} */ (seen.srcObject)?.getTracks() ?? []) track.stop();
  seen.srcObject = null;
  begin.hidden = false;
  tell(t(`eye.${WHY[name] ?? 'refused'}`), true);
}

/** Wait for the camera's next picture. There is only one wait at a time, even if the camera is started several times. */
function next() {
  const video = /** @type {any} */ (seen);
  if (video.requestVideoFrameCallback) {
    video.cancelVideoFrameCallback(waiting);
    waiting = video.requestVideoFrameCallback(look);
  } else {
    clearTimeout(waiting);
    waiting = /** @type {any} */ (setTimeout(() => look(performance.now(), {}), 1000 / wanted.rate_hz));
  }
}

/** Process a new picture of the camera. @param {number} nowMs @param {{captureTime?: number}} about */
async function look(nowMs, about) {
  next();
  if (isPacking || !link.hasCredit || nowMs < dueMs || seen.readyState < HAS_PICTURE) return;
  const everyMs = 1000 / wanted.rate_hz;
  dueMs = Math.max(dueMs, nowMs - everyMs) + everyMs; // if a picture is late, the next one is not delayed
  const taken = about.captureTime ?? nowMs;
  isPacking = true;
  try {
    const packed = await pack();
    if (!packed) packer ??= makePacker();
    else if (link.show(new Uint8Array(packed.jpeg), nowMs - taken > LATE_MS ? nowMs : taken, packed.covered)) sent += 1;
  } finally {
    isPacking = false;
  }
}

/** @returns {Promise<{jpeg: ArrayBuffer, covered: boolean} | null>} null if the worker cannot encode pictures */
async function pack() {
  const to = { width: wanted.width, height: wanted.height };
  if (packer) return packer.pack(seen, seen.videoWidth, seen.videoHeight, to);
  const bitmap = await createImageBitmap(seen);
  return new Promise((done) => {
    /** @type {Worker} */ (worker).onmessage = ({ data }) => done(data);
    /** @type {Worker} */ (worker).postMessage({ bitmap, to }, [bitmap]);
  });
}

link.addEventListener('hello', (event) => (wanted = /** @type {CustomEvent} */ (event).detail));
link.addEventListener('state', (event) => {
  const state = /** @type {CustomEvent} */ (event).detail;
  const reason = `stop.${state.stop_reason}`;
  if (state.emergency) tell(t('emergency'), true);
  else if (state.fault) tell(state.fault, true);
  else if (state.mode === 'stopped' && state.stop_reason && has(reason)) tell(t(reason));
  else tell(t(state.driven_by === 'nobody' ? 'eye.stands' : 'eye.drives'));
  document.body.dataset.mode = state.mode;
});
link.addEventListener('lost', () => {
  tell(t('out_of_reach'), true);
  askWhy('eye');
});
link.addEventListener('closed', (event) => {
  const code = /** @type {CustomEvent} */ (event).detail;
  tell(t(code === 4001 ? 'eye.another' : code === 4003 ? 'eye.viewer' : 'eye.other_camera'), true);
  wakeLock.want(false);
});
setInterval(() => {
  figures.textContent = t('eye.rate', { n: sent });
  document.body.dataset.sent = String(Number(document.body.dataset.sent ?? 0) + sent);
  sent = 0;
}, 1000);

/** Also send STOP by HTTP requests until the robot confirms one, because the websocket may be dead without an error, or another phone may have replaced it. */
async function stopRobot() {
  link.stop();
  if ((await askToStop(() => link.owesStop)) !== null) link.owesStop = false;
}
stop.addEventListener('pointerdown', stopRobot);
listenForStop({ stop: stopRobot, mayMove: () => document.body.dataset.mode !== 'stopped' });
stop.addEventListener('click', stopRobot);
begin.addEventListener('click', open);
document.addEventListener('visibilitychange', () => document.visibilityState === 'visible' && wakeLock.want(true));
open();
