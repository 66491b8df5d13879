// What a key is: by its place (`code`), by what it says (`key`), and by its old number (`keyCode`).
//
// A keyboard may leave any of them out: browsers on Android and televisions send no `code`, an input
// method no `key`. A stop counts if any of them says stop. The page needs this before the keyboard drives.

/** @typedef {{code?: string, key?: string, keyCode?: number, location?: number, repeat?: boolean}} Key  the part of a KeyboardEvent that is read here */

/** The space bar; the last two with Shift or Alt in some layouts, and in full width. */
const SPACES = new Set([' ', 'Spacebar', '\u00a0', '\u3000']);
const STOPS = new Set([
  'Escape', 'Esc', 'Pause', 'MediaStop', 'MediaPause', 'MediaPlayPause',
  'GoBack', 'BrowserBack', // a remote control's way out
]);
/** The same by number; those above 255 are televisions'. */
const STOP_NUMBERS = new Set([19, 27, 178, 179, 413, 461, 10009, 10252]);

const ARROW_NUMBERS = ['ArrowLeft', 'ArrowUp', 'ArrowRight', 'ArrowDown'];
const ENTERS = ['Enter', 'Select', 'Accept', 'OK'];

/** What a key says, or else what its number says; empty if neither says anything. @param {Key} event */
export function nameOf({ key, keyCode = 0 }) {
  if (key && key !== 'Unidentified' && key !== 'Process') return key.length === 1 ? key.toLowerCase() : key;
  if (keyCode >= 37 && keyCode <= 40) return ARROW_NUMBERS[keyCode - 37];
  if (keyCode === 13) return 'Enter';
  if ((keyCode >= 49 && keyCode <= 57) || (keyCode >= 65 && keyCode <= 90)) return String.fromCharCode(keyCode).toLowerCase();
  return keyCode && keyCode !== 229 && keyCode !== 255 ? `#${keyCode}` : ''; // 229: composing; 255: no key of any layout
}

/** True if a key holds what has the focus, as Enter does. @param {Key} event */
export const isEnter = (event) => ENTERS.includes(nameOf(event));

/** @param {Key} event @returns {string} empty for a key without a place */
export const placeOf = ({ code }) => (code && code !== 'Unidentified' ? code : '');

/** How a key says stop: `space` and what a browser cannot name write in a text field, or may. @param {Key} event @returns {'space' | 'unnamed' | 'named' | null} */
export function stopOf(event) {
  const [place, name] = [placeOf(event), nameOf(event)];
  if (!place && !name) return 'unnamed'; // it may be the stop, so it is
  if (place === 'Space' || event.keyCode === 32 || SPACES.has(name)) return 'space';
  return STOPS.has(place) || STOPS.has(name) || STOP_NUMBERS.has(event.keyCode ?? 0) ? 'named' : null;
}
