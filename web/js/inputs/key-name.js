// Identifies a key by its position (`code`), its character (`key`), and its old number (`keyCode`).
// Position, character or number may be missing:
// Browsers on Android and televisions send no `code`, and input methods send no `key`.
// A key stops the robot if its position, its character or its number means stop.
// This module is loaded with the page, because STOP keys must work before the code of the keyboard has loaded.

/** @typedef {{code?: string, key?: string, keyCode?: number, location?: number, repeat?: boolean}} Key  the fields of a KeyboardEvent that are used here */

/** Names of the space bar. Some layouts send the third with Shift or Alt; the last is the full-width space. */
const SPACES = new Set([' ', 'Spacebar', '\u00a0', '\u3000']);
const STOPS = new Set([
  'Escape', 'Esc', 'Pause', 'MediaStop', 'MediaPause', 'MediaPlayPause',
  'GoBack', 'BrowserBack', // the Back key of a remote control
]);
/** The same keys by their old number; televisions use the numbers above 255. */
const STOP_NUMBERS = new Set([19, 27, 178, 179, 413, 461, 10009, 10252]);

const ARROW_NUMBERS = ['ArrowLeft', 'ArrowUp', 'ArrowRight', 'ArrowDown'];
const ENTERS = ['Enter', 'Select', 'Accept', 'OK'];

/** Return the name of a key, or else the name for its old number; empty if it has neither. @param {Key} event */
export function nameOf({ key, keyCode = 0 }) {
  if (key && key !== 'Unidentified' && key !== 'Process') return key.length === 1 ? key.toLowerCase() : key;
  if (keyCode >= 37 && keyCode <= 40) return ARROW_NUMBERS[keyCode - 37];
  if (keyCode === 13) return 'Enter';
  if ((keyCode >= 49 && keyCode <= 57) || (keyCode >= 65 && keyCode <= 90)) return String.fromCharCode(keyCode).toLowerCase();
  return keyCode && keyCode !== 229 && keyCode !== 255 ? `#${keyCode}` : ''; // 229 means that a text is being composed, and 255 is an unknown key
}

/** True if the key acts on the focused element, like Enter. @param {Key} event */
export const isEnter = (event) => ENTERS.includes(nameOf(event));

/** @param {Key} event @returns {string} empty for a key without a position */
export const placeOf = ({ code }) => (code && code !== 'Unidentified' ? code : '');

/** The kind of a stop key, or null for another key. In a text field, a `space` key types a space, and an `unnamed` key may type something. @param {Key} event @returns {'space' | 'unnamed' | 'named' | null} */
export function stopOf(event) {
  const [place, name] = [placeOf(event), nameOf(event)];
  if (!place && !name) return 'unnamed'; // count it as a stop key, because it may be one
  if (place === 'Space' || event.keyCode === 32 || SPACES.has(name)) return 'space';
  return STOPS.has(place) || STOPS.has(name) || STOP_NUMBERS.has(event.keyCode ?? 0) ? 'named' : null;
}
