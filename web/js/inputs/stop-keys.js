// The keys that stop a robot that may move, wherever the focus is: before any button, list or dialog
// gets them. In a text field beside no picture, space writes.

import { isEnter, stopOf } from './key-name.js';

const WRITTEN = 'textarea, input:not([type=button], [type=submit], [type=reset], [type=radio], [type=checkbox], [type=range], [type=color], [type=file])';

const isEscape = (/** @type {KeyboardEvent} */ { key }) => key === 'Escape' || key === 'Esc';

/** @param {any} target */
const isText = (target) => target?.matches?.(WRITTEN) || target?.isContentEditable === true;

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
  addEventListener('keydown', (event) => {
    if (isEscape(event)) feel(event); // what it closes, if anything, comes first
    // A browser presses what has the focus by Enter, and not by a remote control's other names of it.
    const { target } = event;
    if (!isEnter(event) || event.key === 'Enter' || event.defaultPrevented || event.repeat) return;
    if (target instanceof HTMLElement && target.matches('a, button')) target.click();
  });
  addEventListener('keyup', (event) => {
    const isSpace = stopOf(event) === 'space' && mayMove() && !isText(event.target);
    if (isFelt || isSpace) event.preventDefault(); // or a browser presses the button that has the focus
    isFelt = false;
  }, true);
  addEventListener('blur', () => (isFelt = false));
}
