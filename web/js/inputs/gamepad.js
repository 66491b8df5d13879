// A game controller: the cross or the left stick drives, the second button (B, circle) stops.

const ON = 0.6;
const OFF = 0.4;
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

/** @param {import('../helm.js').Helm} helm @param {{stop: () => void, isDriving: () => boolean}} page */
export function listenToGamepads(helm, { stop, isDriving }) {
  /** @type {Map<number, {move: string | null, stop: boolean}>} */
  const last = new Map();
  let polling = false;

  const poll = () => {
    const pads = navigator.getGamepads().filter((pad) => pad?.connected);
    for (const [index] of last) {
      if (!pads.some((pad) => pad?.index === index)) {
        last.delete(index);
        helm.release(`gamepad ${index}`);
      }
    }
    for (const pad of pads) if (pad) follow(pad);
    polling = pads.length > 0;
    if (polling) requestAnimationFrame(poll);
  };

  /** @param {Gamepad} pad */
  const follow = (pad) => {
    const before = last.get(pad.index) ?? { move: null, stop: false };
    const now = {
      move: isDriving() ? readGamepad(pad, before.move) : null,
      stop: Boolean(pad.buttons[1]?.pressed),
    };
    last.set(pad.index, now);
    if (now.stop && !before.stop) stop();
    if (now.move === before.move) return;
    if (now.move) helm.press(`gamepad ${pad.index}`, now.move);
    if (!now.move || !helm.moves.includes(now.move)) helm.release(`gamepad ${pad.index}`);
  };

  addEventListener('gamepadconnected', () => {
    if (!polling) poll();
  });
}
