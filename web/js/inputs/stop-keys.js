// The keys that stop a robot that may move, wherever the focus is: before any button, list or dialog
// gets them. In a text field beside no picture, space writes.

import { isEnter } from './key-name.js';
import { Presses, stopOf } from './keys.js';

const WRITTEN = 'textarea, input:not([type=button], [type=submit], [type=reset], [type=radio], [type=checkbox], [type=range], [type=color], [type=file], [type=image])';

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
  const presses = new Presses();
  /** @type {Set<string>} those that have stopped it and are still down */
  const felt = new Set();
  const feel = (/** @type {KeyboardEvent} */ event) => {
    const how = stopOf(event);
    if (!how || event.defaultPrevented || (how !== 'named' && isText(event.target) && !isDriving())) return;
    if (!mayMove() && (how !== 'space' || event.target !== document.body)) return;
    event.preventDefault();
    event.stopPropagation();
    const press = presses.press(event);
    if (!event.repeat || !felt.has(press)) stop();
    felt.add(press);
  };
  addEventListener('keydown', (event) => {
    presses.press(event);
    if (!isEscape(event)) feel(event);
  }, true);
  addEventListener('keydown', (event) => {
    if (isEscape(event)) feel(event); // what it closes, if anything, comes first
    // A browser presses what has the focus by Enter, and not by a remote control's other names of it.
    const { target } = event;
    if (!isEnter(event) || event.key === 'Enter' || event.defaultPrevented || event.repeat) return;
    if (target instanceof HTMLElement && target.matches('a, button')) target.click();
  });
  addEventListener('keyup', (event) => {
    const press = presses.release(event);
    if (press === null ? felt.size : felt.has(press)) event.preventDefault(); // or a browser presses the button that has the focus
    else if (stopOf(event) === 'space' && mayMove() && !isText(event.target)) event.preventDefault();
    if (press === null) felt.clear();
    else felt.delete(press);
  }, true);
  addEventListener('blur', () => {
    presses.clear();
    felt.clear();
  });
}
