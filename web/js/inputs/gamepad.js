// A game controller: the cross or the left stick drives, the second button (B, circle) stops.
// If the robot accepts proportional steering, the stick steers, and a pulled trigger sets the throttle.
// If the browser does not know a pad's layout, the pad can drive only after a person has shown its directions.
// Of several pads, the one that was touched last drives.

import { REST, beyond, fromStick } from '../points.js';
import { DIRECTIONS, PULLED, PadChoice, RestedPad, valuesOf } from './pad-rest.js';

const ON = 0.6;
const OFF = 0.4;
const AHEAD = 7;
const BACK = 6;
const CROSS = { 12: 'forward', 13: 'backward', 14: 'left', 15: 'right' };

/**
 * Return the move that a controller requests. A stick that was pushed counts as released only near its middle.
 * @param {{buttons: readonly {pressed: boolean}[], axes: readonly number[]}} pad
 * @param {string | null} before  the move that it requested last
 * @returns {string | null}
 */
export function readGamepad(pad, before) {
  for (const [index, move] of Object.entries(CROSS)) {
    if (pad.buttons[Number(index)]?.pressed) return move;
  }
  const [x = 0, y = 0] = pad.axes;
  const across = Math.abs(x) > Math.abs(y);
  const push = across ? Math.abs(x) : Math.abs(y);
  const move = across ? (x < 0 ? 'left' : 'right') : y < 0 ? 'forward' : 'backward';
  return push > (move === before ? OFF : ON) ? move : null;
}

/**
 * Return the steering and throttle of a controller; null if it is at rest.
 * @param {{buttons: readonly {pressed: boolean, value: number}[], axes: readonly number[]}} pad
 * @param {import('../points.js').Reach} reach
 */
export function readStick({ buttons, axes: [x = 0, y = 0] }, reach) {
  const pull = beyond((buttons[AHEAD]?.value ?? 0) - (buttons[BACK]?.value ?? 0), PULLED);
  if (!pull) return fromStick(x, -y, reach);
  const throttle = pull * (pull > 0 ? reach.ahead : reach.back);
  return throttle ? { steering: beyond(x, REST), throttle } : null;
}

/** True if the browser does not know this pad's layout. @param {{mapping?: string}} pad */
const isUnknown = ({ mapping }) => mapping === '';
/** How long after connecting a stick may be off its middle before the page reports it, in milliseconds. */
export const UNRESTED_MS = 2000;

/** If the pads were last read longer ago than this, a heartbeat reads them again, in milliseconds. */
const UNDRAWN_MS = 50;

/** A pad's name for people, without the numbers that browsers add. @param {string} id */
export const padName = (id = '') => id.replace(/\s*\([^()]*(?:Vendor|STANDARD)[^()]*\)|^[\da-f]{1,4}-[\da-f]{1,4}-/gi, '').trim().slice(0, 40) || 'Gamepad';

/**
 * What the page does for game pads: it stores their directions and shows texts about them.
 * @typedef {object} PadDesk
 * @property {(id: string) => import('./pad-rest.js').Choice | null} choiceOf
 * @property {(id: string, choice: import('./pad-rest.js').Choice) => void} keep
 * @property {(name: string, begin: () => void) => void} offer  called when a pad of an unknown layout is touched
 * @property {(name: string, direction: string | undefined, skip: () => void) => void} ask  `rest`: release everything; undefined: all directions are known
 * @property {(key: 'pad.used' | 'pad.unrested', name: string) => void} tell
 */

/** @typedef {{id: string, reading: RestedPad, move: string | null, isPushed: boolean, stop: boolean, sinceMs: number, first: readonly number[] | null, choosing: PadChoice | null}} Followed */

/** @param {import('../helm.js').Helm} helm @param {{stop: () => void, isDriving: () => boolean, desk: PadDesk}} page */
export function listenToGamepads(helm, { stop, isDriving, desk }) {
  /** @type {Map<number, Followed>} */
  const followed = new Map();
  let polling = false;
  let lookedMs = -Infinity;
  /** @type {number | null} the last touched pad */
  let inUse = null;

  /** @param {number} index */
  const letGo = (index) => {
    helm.release(`gamepad ${index}`);
    helm.release(`gamepad ${index} stick`);
  };

  const look = () => {
    lookedMs = performance.now();
    const pads = navigator.getGamepads().filter((pad) => pad?.connected);
    for (const [index, { id }] of followed) {
      if (!pads.some((pad) => pad?.index === index && pad.id === id)) {
        followed.delete(index);
        letGo(index);
      }
    }
    for (const pad of pads) if (pad) follow(pad);
  };

  const poll = () => {
    look();
    polling = followed.size > 0;
    if (polling) requestAnimationFrame(poll);
  };
  // A browser draws no frames while another window covers the page, but the page's heartbeats go on.
  helm.read = () => {
    if (polling && performance.now() - lookedMs >= UNDRAWN_MS) look();
  };

  /** @param {Gamepad} pad @returns {Followed} */
  const meet = (pad) => {
    return { id: pad.id, reading: new RestedPad(), move: null, isPushed: false, stop: false, sinceMs: performance.now(), first: null, choosing: null };
  };

  /** Follow a pad whose layout the browser does not know. Until a person has shown the pad's directions, the pad can only stop the robot. @param {Gamepad} pad @param {Followed} state */
  const findLayout = (pad, state) => {
    const values = valuesOf(pad);
    state.first ??= values;
    const { first, choosing } = state;
    if (!choosing) {
      if (!values.some((value, i) => Math.abs(value - (first[i] ?? value)) > OFF)) return;
      state.first = null;
      desk.offer(padName(pad.id), () => {
        state.choosing = new PadChoice(DIRECTIONS.filter((name) => helm.moves.includes(name)));
        askNext(state);
      });
      return;
    }
    const { asked } = choosing;
    choosing.watch(pad, performance.now());
    if (choosing.asked !== asked) askNext(state);
  };

  /** @param {Followed} state */
  const askNext = (state) => {
    const { id, choosing } = state;
    desk.ask(padName(id), choosing?.asked, () => {
      choosing?.skip();
      askNext(state);
    });
    if (!choosing || choosing.asked) return;
    state.choosing = null;
    if (Object.keys(choosing.choice).length) desk.keep(id, choosing.choice);
  };

  /** @param {Gamepad} pad */
  const follow = (pad) => {
    const { index } = pad;
    const state = followed.get(index) ?? meet(pad);
    followed.set(index, state);
    const choice = isUnknown(pad) ? desk.choiceOf(pad.id) : null;
    if (choice !== state.reading.choice) state.reading = new RestedPad(choice);
    const isKnown = !isUnknown(pad) || choice !== null;
    if (!isKnown) findLayout(pad, state);
    const { axes: ways, buttons } = isKnown ? state.reading.read(pad) : { axes: [], buttons: pad.buttons.map(({ pressed }, i) => ({ value: 0, pressed: pressed && i === 1 && !state.choosing })) };
    if (isKnown && performance.now() - state.sinceMs > UNRESTED_MS) {
      state.sinceMs = Infinity; // report a stick that is off its middle only once
      if ([...state.reading.waiting].some((name) => !name.startsWith('button'))) desk.tell('pad.unrested', padName(pad.id));
    }
    const source = `gamepad ${index}`;
    const stick = `${source} stick`;
    const before = { ...state };
    const point = isDriving() && helm.takesPoints ? readStick({ buttons, axes: ways }, helm.reach) : null;
    state.move = isDriving() ? readGamepad({ buttons, axes: helm.takesPoints ? [] : ways }, before.move) : null;
    state.isPushed = point !== null;
    state.stop = Boolean(buttons[1]?.pressed);
    const isTouched = (state.move && !before.move) || (point && !before.isPushed);
    if (isTouched && index !== inUse) {
      for (const other of followed.keys()) if (other !== index) letGo(other);
      if (followed.size > 1) desk.tell('pad.used', padName(pad.id));
      inUse = index;
    }
    if (state.stop && !before.stop) stop();
    if (point && !before.isPushed) helm.grasp(stick);
    if (point) helm.steer(stick, point);
    else if (before.isPushed) helm.release(stick);
    if (state.move === before.move || (index !== inUse && before.move && state.move)) return;
    if (state.move) helm.press(source, state.move);
    if (!state.move || !helm.moves.includes(state.move)) helm.release(source);
  };

  addEventListener('gamepadconnected', () => {
    if (!polling) poll();
  });
}
