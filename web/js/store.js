// The page's state, which components watch. This module does not use the document.

/** @typedef {import('./protocol.js').RobotState} RobotState */
/**
 * What an extension sets to lead the pilot: its texts then replace the robot's, and the agreement is hidden.
 * @typedef {object} Lead
 * @property {boolean} isOver  nothing is left to be driven
 * @property {(robot: RobotState) => import('./advice.js').Advice | null} ask  the next thing to do
 * @property {import('./advice.js').Told | null} told  the text while nothing is urgent
 * @property {any} own  the extension's private data
 */
/** @typedef {{text: string, step: {label: string, act: () => void} | null}} Toast */
/**
 * @typedef {object} PageState
 * @property {'connecting' | 'open' | 'lost'} link
 * @property {import('./way.js').Way | null} way  why there is no link, if known
 * @property {boolean} isWatching  pictures come by plain requests
 * @property {string} robotName
 * @property {'pilot' | 'viewer'} role  the role that this browser can have
 * @property {string[]} moves
 * @property {boolean} takesPoints  the robot accepts proportional steering
 * @property {boolean} hasStick  the robot accepts proportional steering, and its pilot wants a thumb stick instead of the arrows
 * @property {RobotState | null} robot  null before the first state
 * @property {number | null} frame  id of the picture on the screen
 * @property {number | null} pictureAgeMs  the age of this picture when it was drawn
 * @property {number | null} drawnAgeMs  the age of pictures when they are drawn, smoothed
 * @property {number} drawingMs  the part of this age spent on this phone, smoothed
 * @property {number | null} delayMs  round trip of a message
 * @property {string | null} held  the move held on this page
 * @property {string} screen
 * @property {'hidden' | 'elsewhere' | 'wheel' | null} localStop  why the robot stands still, if this page is the cause: it requested a stop, or has just got the wheel
 * @property {number[]} agreement  newest last; one value for every five to ten examples
 * @property {boolean} wheelAsked  somebody else requests the wheel
 * @property {boolean} wheelWaiting  this page requested the wheel
 * @property {Lead | null} lead
 * @property {import('./advice.js').Readiness | null} readiness  null before the first request
 * @property {string | null} setback  why the robot now has to drive by itself for longer than before
 * @property {import('./advice.js').Told | null} told  an extension's text instead of the advice
 * @property {boolean} isLocal  the page is on the robot's computer, so no link can be slow
 * @property {boolean} hasKeys  there is a mouse, and therefore probably a keyboard
 * @property {string | null} hint  the shown hint of the first visit
 * @property {Toast | null} toast  a sentence that disappears by itself, on any screen
 * @property {string | null} notice  a short text that disappears by itself
 */

/** @returns {PageState} */
export const initialState = () => ({
  link: 'connecting',
  way: null,
  isWatching: false,
  robotName: '',
  role: 'pilot',
  moves: ['forward', 'left', 'right'],
  takesPoints: false,
  hasStick: false,
  robot: null,
  frame: null,
  pictureAgeMs: null,
  drawnAgeMs: null,
  drawingMs: 0,
  delayMs: null,
  held: null,
  screen: 'drive',
  localStop: null,
  agreement: [],
  wheelAsked: false,
  wheelWaiting: false,
  lead: null,
  readiness: null,
  setback: null,
  told: null,
  isLocal: false,
  hasKeys: false,
  hint: null,
  notice: null,
  toast: null,
});

export class Store extends EventTarget {
  /** @param {Partial<PageState>} [state] */
  constructor(state = {}) {
    super();
    /** @type {PageState} */
    this.state = { ...initialState(), ...state };
  }

  /** Change some fields, and call the watchers of fields that really changed. @param {Partial<PageState>} patch */
  set(patch) {
    const before = this.state;
    this.state = { ...before, ...patch };
    for (const key of /** @type {(keyof PageState)[]} */ (Object.keys(patch))) {
      if (before[key] !== this.state[key]) this.dispatchEvent(new Event(key));
    }
  }

  /**
   * Call `tell` now and after each change of one of `keys`.
   * @param {(keyof PageState)[]} keys
   * @param {(state: PageState) => void} tell
   * @returns {() => void} call it to stop watching
   */
  watch(keys, tell) {
    const listener = () => tell(this.state);
    for (const key of keys) this.addEventListener(key, listener);
    listener();
    return () => keys.forEach((key) => this.removeEventListener(key, listener));
  }
}
