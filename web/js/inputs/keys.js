// What a key means: by its place (`code`), by what it says (`key`), and by its old number (`keyCode`).
//
// A keyboard may leave any of them out: browsers on Android and televisions send no `code`, an input
// method no `key`. A stop counts if any of them says stop. Letters and figures count by their place, so
// that each layout drives alike; an arrow also by what it says, wherever it lies.

import { nameOf } from './key-name.js';

/** @typedef {import('./key-name.js').Key} Key */

/** The space bar; the last two with Shift or Alt in some layouts, and in full width. */
const SPACES = new Set([' ', 'Spacebar', '\u00a0', '\u3000']);
const STOPS = new Set([
  'Escape', 'Esc', 'Pause', 'Cancel', 'BrowserStop', 'MediaStop', 'MediaPause', 'MediaPlayPause',
  'GoBack', 'BrowserBack', 'XF86Back', 'Exit', // a remote control's way out
]);
/** The same by number; those above 255 are televisions'. */
const STOP_NUMBERS = new Set([3, 19, 27, 166, 169, 178, 179, 413, 461, 10009, 10182, 10252]);

const BY_PLACE = /** @type {Record<string, string>} */ ({
  KeyW: 'forward', KeyA: 'left', KeyD: 'right', KeyS: 'backward', KeyQ: 'spin_left', KeyE: 'spin_right',
  Numpad8: 'forward', Numpad4: 'left', Numpad6: 'right', Numpad2: 'backward',
});
const ARROWS = /** @type {Record<string, string>} */ ({
  ArrowUp: 'forward', ArrowLeft: 'left', ArrowRight: 'right', ArrowDown: 'backward',
  Up: 'forward', Left: 'left', Right: 'right', Down: 'backward',
  UIKeyInputUpArrow: 'forward', UIKeyInputLeftArrow: 'left', UIKeyInputRightArrow: 'right', UIKeyInputDownArrow: 'backward',
});
const NUMPAD = 3;
const LATIN = /^[a-z0-9]$/;

/** @param {Key} event @returns {string} empty for a key without a place */
const placeOf = ({ code }) => (code && code !== 'Unidentified' ? code : '');

/** How a key says stop: `space` and what a browser cannot name write in a text field, or may. @param {Key} event @returns {'space' | 'unnamed' | 'named' | null} */
export function stopOf(event) {
  const [place, name] = [placeOf(event), nameOf(event)];
  if (!place && !name) return 'unnamed'; // it may be the stop, so it is
  if (place === 'Space' || event.keyCode === 32 || SPACES.has(name)) return 'space';
  return STOPS.has(place) || STOPS.has(name) || STOP_NUMBERS.has(event.keyCode ?? 0) ? 'named' : null;
}

/**
 * The move that a key asks for, if any.
 * @param {Key} event
 * @param {readonly string[]} moves  the robot's, in its order
 * @returns {{move: string | undefined, isNth: boolean}} `isNth`: by its number in that order
 */
export function moveOfKey(event, moves) {
  const [place, name] = [placeOf(event), nameOf(event)];
  const position = place || positionOf(LATIN.test(name) ? name : nameOf({ keyCode: event.keyCode }), event.location === NUMPAD);
  const nth = Number(position.match(/^Digit([1-9])$/)?.[1] ?? 0);
  const move = ARROWS[name] ?? ARROWS[position] ?? BY_PLACE[position];
  return { move: move ?? moves[nth - 1], isNth: !move };
}

/** Where a key without a place lies, by what is written on it, or in Latin letters beside it. @param {string} name @param {boolean} isOnPad */
function positionOf(name, isOnPad) {
  if (name.length !== 1) return '';
  return isOnPad ? `Numpad${name}` : `${name >= 'a' ? 'Key' : 'Digit'}${name.toUpperCase()}`;
}

/**
 * The keys that are down. Which of them comes up is clear by its place. Without one it is clear by its
 * name only while no letter or figure is down: they change with the layout, with Shift and with Num Lock.
 * Otherwise any of them may have come up.
 */
export class Presses {
  /** @type {{place: string, name: string, location: number, id: string}[]} */
  down = [];

  /** @param {Key} event @returns {string} one and the same until the key comes up */
  press(event) {
    const [place, name, location] = [placeOf(event), nameOf(event), event.location ?? 0];
    const known = this.find(event);
    if (known || (!place && !name)) return known?.id ?? '';
    const id = place || `${name} ${location}`;
    if (!event.repeat) this.down.push({ place, name, location, id }); // else its name has changed since it went down
    return id;
  }

  /** @param {Key} event @returns {string | null} what `press` returned; null: it may be any of them */
  release(event) {
    const known = this.find(event);
    if (!known) return null;
    this.down.splice(this.down.indexOf(known), 1);
    const isClear = (known.place && placeOf(event)) || [known, ...this.down].every(({ place, name }) => place || name.length > 1);
    return isClear ? known.id : null;
  }

  /** @param {Key} event */
  find(event) {
    const [place, name, location] = [placeOf(event), nameOf(event), event.location ?? 0];
    return this.down.find((press) => (press.place && place ? press.place === place : name && press.name === name && press.location === location));
  }

  clear() {
    this.down = [];
  }
}
