// Which move each key stands for, and which keys are held down (key-name.js identifies keys and stop keys).
//
// Letters and digits count by their position, so that driving is the same with all keyboard layouts.
// Arrows also count by their name, whatever their position.

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
 * The move that a key requests, if any.
 * @param {Key} event
 * @param {readonly string[]} moves  the robot's moves, in its order
 * @returns {{move: string | undefined, isNth: boolean}} `isNth`: requested by its number in this order
 */
export function moveOfKey(event, moves) {
  const [place, name] = [placeOf(event), nameOf(event)];
  const position = place || positionOf(LATIN.test(name) ? name : nameOf({ keyCode: event.keyCode }), event.location === NUMPAD);
  const nth = Number(position.match(/^Digit([1-9])$/)?.[1] ?? 0);
  const move = ARROWS[name] ?? ARROWS[position] ?? BY_PLACE[position];
  return { move: move ?? moves[nth - 1], isNth: !move };
}

/** Return the position of a key without a `code`, from its label, or from the Latin letter on the same key. @param {string} name @param {boolean} isOnPad */
function positionOf(name, isOnPad) {
  if (name.length !== 1) return '';
  return isOnPad ? `Numpad${name}` : `${name >= 'a' ? 'Key' : 'Digit'}${name.toUpperCase()}`;
}

/**
 * The keys that are down. A released key is identified by its position. Without a position, its name
 * identifies it only while no letter or digit is down, because their names change with the layout, Shift and
 * Num Lock. If a letter or digit is down, any key may have been released.
 */
export class Presses {
  /** @type {{place: string, name: string, location: number, id: string}[]} */
  down = [];

  /** @param {Key} event @returns {string} an id that stays the same until the key is released */
  press(event) {
    const [place, name, location] = [placeOf(event), nameOf(event), event.location ?? 0];
    const known = this.find(event);
    if (known || (!place && !name)) return known?.id ?? '';
    const id = place || `${name} ${location}`;
    if (!event.repeat) this.down.push({ place, name, location, id }); // a repeated key that is not known is an earlier one whose name has changed
    return id;
  }

  /** @param {Key} event @returns {string | null} the id from `press`; null: it may be any key */
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
