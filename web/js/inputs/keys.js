// The moves of keys, and which keys are down (key-name.js says what a key is and which ones stop).
//
// Letters and figures count by their place, so that each layout drives alike; an arrow also by what it
// says, wherever it lies.

import { nameOf, placeOf } from './key-name.js';

/** @typedef {import('./key-name.js').Key} Key */

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
