// What the page knows, in one place that components watch. Nothing here touches the document.

/** @typedef {import('./protocol.js').RobotState} RobotState */
/**
 * An extension leads the pilot: its words come before the robot's own, and how well it goes is not shown.
 * @typedef {object} Lead
 * @property {boolean} isOver  nothing is left to be driven
 * @property {(robot: RobotState) => import('./advice.js').Advice | null} ask  what is to be done next
 * @property {import('./advice.js').Told | null} told  what is said while nothing is urgent
 * @property {any} own  what the extension itself keeps
 */
/** @typedef {{text: string, step: {label: string, act: () => void} | null}} Toast */
/**
 * @typedef {object} PageState
 * @property {'connecting' | 'open' | 'lost'} link
 * @property {import('./way.js').Way | null} way  why there is no link, as far as it is known
 * @property {boolean} isWatching  pictures come by plain requests
 * @property {string} robotName
 * @property {'pilot' | 'viewer'} role  what this browser may become
 * @property {string[]} moves
 * @property {boolean} takesPoints  the robot can be steered by degrees
 * @property {boolean} hasStick  and its pilot wants a thumb stick in place of the arrows
 * @property {RobotState | null} robot  null before the first state
 * @property {number | null} frame  id of the picture on the screen
 * @property {number | null} pictureAgeMs  how old that picture was when it was drawn
 * @property {number | null} drawnAgeMs  how old pictures are when they are drawn, smoothed
 * @property {number} drawingMs  how much of that they spend on this phone, smoothed
 * @property {number | null} delayMs  round trip of a message
 * @property {string | null} held  what the pilot holds here
 * @property {string} screen
 * @property {'hidden' | 'elsewhere' | 'wheel' | null} localStop  why the robot stands, as this page knows it: a stop that it asked for, or the wheel has just come to it
 * @property {number[]} agreement  newest last, one for each ten lessons or so
 * @property {boolean} wheelAsked  somebody else asks for the wheel
 * @property {boolean} wheelWaiting  this page asked for it
 * @property {Lead | null} lead
 * @property {import('./readiness.js').Readiness | null} readiness  null before it was asked for
 * @property {string | null} setback  why there is more left to drive alone than a moment ago
 * @property {import('./advice.js').Told | null} told  what an extension says in place of the advice
 * @property {boolean} isLocal  the page is on the robot's own computer: no link could be slow
 * @property {boolean} hasKeys  a mouse, and so a keyboard
 * @property {string | null} hint  which of the first visit's hints is shown
 * @property {Toast | null} toast  a sentence that goes away by itself, on any screen
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

  /** Change some fields; watchers of those that really changed are called. @param {Partial<PageState>} patch */
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
   * @returns {() => void} ends the watching
   */
  watch(keys, tell) {
    const listener = () => tell(this.state);
    for (const key of keys) this.addEventListener(key, listener);
    listener();
    return () => keys.forEach((key) => this.removeEventListener(key, listener));
  }
}
