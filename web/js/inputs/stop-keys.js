// The keys that stop a robot that may move, wherever the focus is: before any button, list or dialog
// gets them. In a text field beside no picture, space writes.

import { stopOf } from './key-name.js';

const isEscape = (/** @type {KeyboardEvent} */ { key }) => key === 'Escape' || key === 'Esc';

/** @param {any} target */
const isText = (target) => target?.isContentEditable || target?.matches?.('textarea') || (target?.matches?.('input') && !/radio|checkbox|range|file/.test(target.type));

/**
 * @param {object} page
 * @param {() => void} page.stop
 * @param {() => boolean} page.mayMove  in doubt, true
 * @param {() => boolean} [page.isDriving]  the picture is on the screen, so that nobody writes
 */
export function listenForStop({ stop, mayMove, isDriving = () => false }) {
  /** A key has stopped it and is still down. */
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
  addEventListener('keydown', (event) => isEscape(event) && feel(event)); // what it closes, if anything, comes first
  addEventListener('keyup', (event) => {
    const isSpace = stopOf(event) === 'space' && mayMove() && !isText(event.target);
    if (isFelt || isSpace) event.preventDefault(); // or a browser presses the button that has the focus
    isFelt = false;
  }, true);
  addEventListener('blur', () => (isFelt = false));
}
