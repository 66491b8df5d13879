// The keys that stop a robot that may be moving.
// The keys act wherever the focus is, before any button, list or dialog gets the key.
// In a text field on a screen without the picture, the space bar types a space.

import { stopOf } from './key-name.js';

const isEscape = (/** @type {KeyboardEvent} */ { key }) => key === 'Escape' || key === 'Esc';

/** @param {any} target */
const isText = (target) => target?.isContentEditable || target?.matches?.('textarea') || (target?.matches?.('input') && !/radio|checkbox|range|file/.test(target.type));

/**
 * @param {object} page
 * @param {() => void} page.stop
 * @param {() => boolean} page.mayMove  true in case of doubt
 * @param {() => boolean} [page.isDriving]  true if the picture is on the screen, so that nobody is typing
 */
export function listenForStop({ stop, mayMove, isDriving = () => false }) {
  /** True while a key that stopped the robot is still down. */
  let isFelt = false;
  const feel = (/** @type {KeyboardEvent} */ event) => {
    const how = stopOf(event);
    if (!how || event.defaultPrevented || (how !== 'named' && isText(event.target) && !isDriving())) return;
    if (!mayMove() && (how !== 'space' || event.target !== document.body)) return;
    event.preventDefault();
    event.stopPropagation();
    if (!event.repeat || !isFelt) stop();
    isFelt = true;
  };
  addEventListener('keydown', (event) => !isEscape(event) && feel(event), true);
  addEventListener('keydown', (event) => isEscape(event) && feel(event)); // last, so that Escape first closes what is open
  addEventListener('keyup', (event) => {
    const isSpace = stopOf(event) === 'space' && mayMove() && !isText(event.target);
    if (isFelt || isSpace) event.preventDefault(); // otherwise the browser would click the focused button
    isFelt = false;
  }, true);
  addEventListener('blur', () => (isFelt = false));
}
