// Arrows and WASD drive while held, the figures 1 to 9 whatever the robot can, in its order; space stops.

/** @type {Record<string, string>} */
const MOVES = {
  ArrowUp: 'forward', KeyW: 'forward',
  ArrowLeft: 'left', KeyA: 'left',
  ArrowRight: 'right', KeyD: 'right',
  ArrowDown: 'backward', KeyS: 'backward',
  KeyQ: 'spin_left', KeyE: 'spin_right',
};

/** @param {EventTarget | null} target */
const isTyping = (target) =>
  target instanceof HTMLElement && target.matches('input:not([type=radio]), textarea, select');

/**
 * @param {import('../helm.js').Helm} helm
 * @param {{stop: () => void, isDriving: () => boolean}} page  `isDriving`: the pad is on the screen
 */
export function listenToKeyboard(helm, { stop, isDriving }) {
  addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target)) return;
    if (event.code === 'Space' && (helm.mode !== 'stopped' || event.target === document.body)) {
      // While the robot may move, space is the stop wherever the focus is; Enter presses buttons.
      event.preventDefault();
      if (!event.repeat) stop();
      return;
    }
    const nth = Number(event.code.match(/^Digit([1-9])$/)?.[1] ?? 0);
    const move = nth ? helm.moves[nth - 1] : MOVES[event.code];
    if (!move || !isDriving() || !helm.moves.includes(move)) return;
    event.preventDefault();
    if (!event.repeat) helm.press(`key ${event.code}`, move);
  });
  addEventListener('keyup', (event) => {
    helm.release(`key ${event.code}`);
    if (event.code === 'Space' && helm.mode !== 'stopped') event.preventDefault();
  });
}
