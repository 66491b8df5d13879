// A game controller: the cross or the left stick drives, the second button (B, circle) stops. Where
// the robot takes degrees, the stick steers by them, and the triggers, if one is pulled, are the throttle.

import { REST, beyond, fromStick } from '../points.js';

const ON = 0.6;
const OFF = 0.4;
const AHEAD = 7;
const BACK = 6;
const PULLED = 0.05;
const CROSS = { 12: 'forward', 13: 'backward', 14: 'left', 15: 'right' };

/**
 * What a controller asks for; the stick must come well back before it counts as let go.
 * @param {{buttons: readonly {pressed: boolean}[], axes: readonly number[]}} pad
 * @param {string | null} before  what it asked for last
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
 * What a controller asks for by degrees; null at rest.
 * @param {{buttons: readonly {pressed: boolean, value: number}[], axes: readonly number[]}} pad
 * @param {import('../points.js').Reach} reach
 */
export function readStick({ buttons, axes: [x = 0, y = 0] }, reach) {
  const pull = beyond((buttons[AHEAD]?.value ?? 0) - (buttons[BACK]?.value ?? 0), PULLED);
  if (!pull) return fromStick(x, -y, reach);
  const throttle = pull * (pull > 0 ? reach.ahead : reach.back);
  return throttle ? { steering: beyond(x, REST), throttle } : null;
}

/** @param {import('../helm.js').Helm} helm @param {{stop: () => void, isDriving: () => boolean}} page */
export function listenToGamepads(helm, { stop, isDriving }) {
  /** @type {Map<number, {move: string | null, isPushed: boolean, stop: boolean}>} */
  const last = new Map();
  let polling = false;

  const poll = () => {
    const pads = navigator.getGamepads().filter((pad) => pad?.connected);
    for (const [index] of last) {
      if (!pads.some((pad) => pad?.index === index)) {
        last.delete(index);
        helm.release(`gamepad ${index}`);
        helm.release(`gamepad ${index} stick`);
      }
    }
    for (const pad of pads) if (pad) follow(pad);
    polling = pads.length > 0;
    if (polling) requestAnimationFrame(poll);
  };

  /** @param {Gamepad} pad */
  const follow = (pad) => {
    const before = last.get(pad.index) ?? { move: null, isPushed: false, stop: false };
    const source = `gamepad ${pad.index}`;
    const stick = `${source} stick`;
    const { buttons } = pad;
    const axes = helm.takesPoints ? [] : pad.axes;
    const point = isDriving() && helm.takesPoints ? readStick(pad, helm.reach) : null;
    const now = { move: isDriving() ? readGamepad({ buttons, axes }, before.move) : null, isPushed: point !== null, stop: Boolean(buttons[1]?.pressed) };
    last.set(pad.index, now);
    if (now.stop && !before.stop) stop();
    if (point && !before.isPushed) helm.grasp(stick);
    if (point) helm.steer(stick, point);
    else if (before.isPushed) helm.release(stick);
    if (now.move === before.move) return;
    if (now.move) helm.press(source, now.move);
    if (!now.move || !helm.moves.includes(now.move)) helm.release(source);
  };

  addEventListener('gamepadconnected', () => {
    if (!polling) poll();
  });
}
