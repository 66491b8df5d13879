// Simulates keyboards and hands: the events that the page gets, and which keys are really down.

/** Random numbers that are the same in each run. @param {number} seed */
export function lottery(seed) {
  let at = seed;
  return () => ((at = (Math.imul(at ^ (at >>> 15), 2246822519) + 374761393) >>> 0) / 2 ** 32);
}

export const MOVES = ['forward', 'left', 'right', 'backward', 'spin_left', 'spin_right'];
const LETTERS = ['KeyW', 'KeyA', 'KeyS', 'KeyD', 'KeyQ', 'KeyE', 'KeyM'];
const LAYOUTS = { qwerty: 'wasdqem', azerty: 'zqsdae,', dvorak: ',aoe\'.m', russian: 'цфывйуь', greek: 'ςασδ;εμ', hebrew: '\'שדג/קצ' };
const FIGURES = { qwerty: '123456', azerty: '&é"\'(-' };
const PAD = { Numpad8: ['ArrowUp', '8'], Numpad4: ['ArrowLeft', '4'], Numpad6: ['ArrowRight', '6'], Numpad2: ['ArrowDown', '2'] };
const NUMBERS = { ArrowLeft: 37, ArrowUp: 38, ArrowRight: 39, ArrowDown: 40, Space: 32, Escape: 27, MediaStop: 178, Pause: 19, BrowserBack: 461, Enter: 13, ShiftLeft: 16, AltLeft: 18, MetaLeft: 91 };
const OLD = { ArrowUp: 'Up', ArrowLeft: 'Left', ArrowRight: 'Right', ArrowDown: 'Down', ' ': 'Spacebar', Escape: 'Esc' };
const NAMES = { Space: ' ', BrowserBack: 'GoBack', ShiftLeft: 'Shift', AltLeft: 'Alt', MetaLeft: 'Meta' };
/** The move that a person means by each key, whatever event the page gets. */
const MEANT = {
  ArrowUp: 'forward', ArrowLeft: 'left', ArrowRight: 'right', ArrowDown: 'backward', Numpad8: 'forward', Numpad4: 'left', Numpad6: 'right', Numpad2: 'backward',
  KeyW: 'forward', KeyA: 'left', KeyD: 'right', KeyS: 'backward', KeyQ: 'spin_left', KeyE: 'spin_right', ...Object.fromEntries(MOVES.map((move, i) => [`Digit${i + 1}`, move])),
};
const BY_LETTER = { w: 'forward', a: 'left', d: 'right', s: 'backward', q: 'spin_left', e: 'spin_right' };
const STOPS = ['Space', 'Space', 'Space', 'Escape', 'MediaStop', 'Pause', 'BrowserBack'];
const TELLS = ['all', 'all', 'no code', 'no code', 'no key', 'number', 'nothing', 'composing', 'composing without code'];
const SIGNS = ['blur', 'hidden', 'contextmenu', 'dragstart', 'AltLeft', 'MetaLeft'];
export const FOCUSES = ['body', 'button', 'select', 'text', 'range', 'dialog'];

/**
 * A history of one keyboard: in each step the page gets an event, or time passes. After the step, a held move must be
 * one of `allowed`, the moves of the keys that are down; after `isStop` the robot must stand.
 * @param {number} seed
 */
export function historyOf(seed, length = 40) {
  const draw = lottery(seed);
  const pick = (/** @type {any} */ from) => from[Math.floor(draw() * from.length)];
  const keyboard = { tells: pick(TELLS), isOld: draw() < 0.2, repeats: pick(['flagged', 'flagged', 'plain', 'never']), hasLocation: draw() < 0.7 };
  let [layout, isNumLock, isShift, hasRepeated] = [pick(Object.keys(LAYOUTS)), draw() < 0.5, false, false];
  /** @type {Map<string, string[]>} the moves of each key that is down */
  const down = new Map();
  let newest = '';
  const steps = [];

  const nameOf = (/** @type {string} */ place) => {
    if (place in PAD) return PAD[place][Number(isNumLock !== isShift)];
    const at = LETTERS.indexOf(place);
    const name = at >= 0 ? LAYOUTS[layout][at] : place.startsWith('Digit') ? (FIGURES[layout] ?? FIGURES.qwerty)[Number(place[5]) - 1] : NAMES[place] ?? place;
    return isShift && name.length === 1 ? name.toUpperCase() : keyboard.isOld ? OLD[name] ?? name : name;
  };
  const tell = (/** @type {string} */ type, /** @type {string} */ place, about = {}) => {
    const name = nameOf(place);
    // A letter of another script has the key code of the Latin letter at its place; a sign has another code.
    const latin = /^[a-z0-9]$/i.test(name) ? name : /^\p{L}$/u.test(name) && name > '\u024f' ? place[3] : '';
    const number = NUMBERS[place] ?? NUMBERS[name] ?? (latin ? latin.toUpperCase().charCodeAt(0) : name.length === 1 ? 222 : 0);
    const known = {
      all: { code: place, key: name, keyCode: number }, 'no code': { code: '', key: name, keyCode: number }, 'no key': { code: place, key: 'Unidentified', keyCode: 0 },
      number: { code: '', key: 'Unidentified', keyCode: number }, nothing: { code: '', key: 'Unidentified', keyCode: pick([0, 229, 255]) },
      composing: { code: place, key: 'Process', keyCode: 229 }, 'composing without code': { code: '', key: 'Process', keyCode: 229 },
    }[keyboard.tells];
    const said = type === 'keydown' || draw() < 0.8 || !keyboard.tells.startsWith('composing') ? known : { ...known, key: name, keyCode: number };
    const modifiers = { altKey: place === 'AltLeft', metaKey: place === 'MetaLeft', ctrlKey: false, shiftKey: isShift };
    steps.push({ type, init: { ...modifiers, repeat: false, location: keyboard.hasLocation && place in PAD ? 3 : 0, ...said, ...about }, allowed: [...down.values()].flat(), isStop: false, place });
  };
  const press = (/** @type {string} */ place) => {
    const name = nameOf(place).toLowerCase();
    const figure = /^[1-9]$/.test(name) ? MOVES[Number(name) - 1] : undefined;
    down.set(place, [MEANT[place], BY_LETTER[name], figure].filter(Boolean));
    newest = place;
    tell('keydown', place, { ctrlKey: draw() < 0.03 });
    const last = /** @type {any} */ (steps.at(-1));
    last.isStop = STOPS.includes(place);
    // A single key must drive, so that a page that never holds a move fails.
    last.drives = down.size === 1 && !last.init.ctrlKey && ['all', 'no key', 'composing'].includes(keyboard.tells) ? MEANT[place] : undefined;
  };
  const comesUp = (/** @type {string} */ place) => {
    down.delete(place);
    tell('keyup', place);
  };
  const lose = (/** @type {string} */ place) => {
    const fallsSilent = hasRepeated && steps.at(-1).type === 'keydown' && steps.at(-1).place === place; // after another key, the end of its repeats means nothing
    const sign = fallsSilent && draw() < 0.5 ? 'silence' : pick(SIGNS);
    if (sign === 'silence') {
      down.delete(place);
      steps.push({ type: 'silence', allowed: [...down.values()].flat(), isStop: false });
      return;
    }
    down.clear(); // in these cases no hand is on the keys any more
    if (sign in NUMBERS) tell('keydown', sign, keyboard.tells.includes('code') ? {} : { code: sign, key: NAMES[sign] });
    else steps.push({ type: sign, allowed: [], isStop: false });
  };

  while (steps.length < length) {
    const chance = draw();
    const held = [...down.keys()];
    const one = () => (down.has(newest) ? newest : pick(held));
    if (chance < 0.4 && held.length < 4) {
      const place = pick(draw() < 0.12 ? STOPS : draw() < 0.9 ? Object.keys(MEANT) : ['KeyM', 'Enter', 'CapsLock']);
      if (!down.has(place)) press(place);
    } else if (chance < 0.65 && held.length) comesUp(pick(held));
    else if (chance < 0.75 && down.has(newest) && keyboard.repeats !== 'never') {
      for (let i = 0; i < 3; i += 1) {
        tell('keydown', newest, { repeat: keyboard.repeats === 'flagged' });
        hasRepeated ||= keyboard.repeats === 'flagged' && keyboard.tells !== 'nothing' && keyboard.tells !== 'composing without code';
      }
    } else if (chance < 0.8 && held.length) lose(one());
    else if (chance < 0.83) layout = pick(Object.keys(LAYOUTS));
    else if (chance < 0.85) isNumLock = !isNumLock;
    else if (chance < 0.88) {
      isShift = !isShift;
      tell(isShift ? 'keydown' : 'keyup', 'ShiftLeft');
    } else if (chance < 0.92) steps.push({ type: 'focus', on: pick(FOCUSES), allowed: [...down.values()].flat(), isStop: false });
    else steps.push({ type: pick(['train', 'autonomous', 'train', 'unlink']), allowed: [...down.values()].flat(), isStop: false });
  }
  return { seed, keyboard, steps };
}
