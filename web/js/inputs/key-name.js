// What a key says; the page needs this before the keyboard drives.

/** @typedef {{code?: string, key?: string, keyCode?: number, location?: number, repeat?: boolean}} Key  the part of a KeyboardEvent that is read here */

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
