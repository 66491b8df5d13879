// The page's connection to the board's server: it receives news and pictures, sends STOP, and reconnects by itself.

import { parsePictures } from './pictures.js';

const RETRY_MS = 1000;
/** Time without an answer after which a stop counts as not received. A running board confirms a stop, or reports its failure, in a fraction of this time. */
const NEWS_MS = 3000;
const ALL = 'all';

/**
 * @typedef {object} Robot  described in server/board/robot_link.py
 * @property {number} number
 * @property {string} address  at which the board reaches the robot
 * @property {string} page  the address of its page for phones
 * @property {string} name
 * @property {'connecting' | 'there' | 'away' | 'not_ours' | 'no_class'} status
 * @property {string} detail  the reason for the status, in English
 * @property {'asked' | 'stopped' | 'not_reached' | null} stop
 * @property {string} stop_id  names the newest STOP; a release must name it
 * @property {boolean} release_refused  the last release was for an older STOP than the newest
 * @property {number | null} delay_ms
 * @property {number} invitations  grows with each new QR code
 * @property {string | null} colour
 * @property {string[]} locks
 * @property {string | null} model
 * @property {Record<string, Record<string, string | number>>} shown  the data that its pilots chose to show here
 * @property {import('../js/protocol.js').Mode | null} mode
 * @property {'nobody' | 'pilot' | 'robot' | null} driven_by
 * @property {boolean | null} emergency
 * @property {string | null} stop_held_by  the role that stopped it, if only this role can release it
 * @property {boolean | null} asks_pilot
 * @property {string | null} fault
 * @property {string | null} link
 * @property {boolean | null} busy
 * @property {number | null} agreement
 * @property {number | null} lessons
 * @property {number | null} battery
 */

/**
 * Events: `news` when robots have changed; `strangers` when robots without a proof of the key have changed;
 * `gone` with the numbers of cards whose robots have another card now, or that a restarted board does not know;
 * `pictures` with a map of numbers to pictures; `link`.
 */
export class ClassLink extends EventTarget {
  /** @param {string} url */
  constructor(url) {
    super();
    this.url = url;
    /** @type {Map<number, Robot>} */
    this.robots = new Map();
    /** @type {Set<number>} robots reported since the connection was opened */
    this.told = new Set();
    /** @type {WebSocket | null} */
    this.socket = null;
    /** @type {number[]} */
    this.watched = [];
    this.isOpen = false;
    /** @type {Set<string>} the addresses of robots whose stop no board has received yet; a restarted board may change the numbers of robots */
    this.owed = new Set();
    /** @type {Set<string>} the addresses of robots whose stop was sent, but not answered yet */
    this.said = new Set();
    /** @type {ReturnType<typeof setTimeout> | undefined} */
    this.doubt = undefined;
  }

  connect() {
    const socket = new WebSocket(this.url);
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => {
      this.told.clear();
      this.turn(true);
      this.watch(this.watched);
    };
    socket.onmessage = ({ data }) => (typeof data === 'string' ? this.hear(data) : this.look(data));
    socket.onclose = () => this.lose();
    this.socket = socket;
  }

  /** Called when the connection has ended, or when the board's program hangs: the last messages may be lost. */
  lose() {
    if (this.socket) this.socket.onopen = this.socket.onmessage = this.socket.onclose = null;
    this.socket?.close();
    this.socket = null;
    for (const address of this.said) this.owed.add(address);
    this.trust();
    this.turn(false);
    setTimeout(() => this.connect(), RETRY_MS);
  }

  /** Called when a message shows that the board is alive, so it has received all stops. */
  trust() {
    clearTimeout(this.doubt);
    this.doubt = undefined;
    this.said.clear();
  }

  /** @param {boolean} isOpen */
  turn(isOpen) {
    if (this.isOpen === isOpen) return;
    this.isOpen = isOpen;
    this.dispatchEvent(new Event('link'));
  }

  /** @param {string} text */
  hear(text) {
    this.trust();
    const { type, robots = [], gone = [], ...words } = JSON.parse(text);
    for (const robot of robots) {
      this.robots.set(robot.number, robot);
      this.told.add(robot.number);
    }
    this.settle(robots);
    const [name, detail] = type === 'strangers' ? [type, words] : ['news', robots];
    this.dispatchEvent(new CustomEvent(name, { detail }));
    this.forget(gone);
    if (type === 'strangers') this.forget([...this.robots.keys()].filter((number) => !this.told.has(number))); // the board sends this message after it has reported all robots
  }

  /** Forget robots that have moved to another card, or that the board does not know and cannot stop. @param {number[]} gone */
  forget(gone) {
    for (const number of gone) this.robots.delete(number);
    if (gone.length) this.dispatchEvent(new CustomEvent('gone', { detail: gone }));
  }

  /** @param {ArrayBuffer} data */
  look(data) {
    this.dispatchEvent(new CustomEvent('pictures', { detail: parsePictures(data) }));
  }

  /** Tell the board that the pictures were drawn, so that it sends the next ones. */
  drawn() {
    this.say({ type: 'drawn' });
  }

  /** Choose the robots whose pictures are shown; none while the page is hidden. @param {number[]} numbers */
  watch(numbers) {
    this.watched = numbers;
    this.say({ type: 'watch', robots: numbers });
  }

  /** Stop one robot or all robots. Without a connection, send an HTTP request; if that fails, the next connection sends the stop. @param {number} [robot] */
  stop(robot) {
    const words = robot === undefined ? {} : { robot };
    const meant = this.meant(robot);
    if (this.say({ type: 'stop', ...words })) {
      if (this.robots.size) this.doubt ??= setTimeout(() => this.lose(), NEWS_MS);
      for (const address of meant) this.said.add(address);
      return;
    }
    for (const address of meant) this.owed.add(address);
    const asked = fetch('api/stop', { method: 'POST', keepalive: true, body: JSON.stringify(words) });
    asked.then((answer) => answer.json()).then(({ robots = [] }) => {
      if (robots.length) this.owed.delete(ALL);
      for (const { address, stop } of robots) if (stop) this.owed.delete(address);
    }).catch(() => {});
  }

  /** Send the stops that no board has received, for the robots that this board has reported so far. @param {Robot[]} robots */
  settle(robots) {
    if (robots.length && this.owed.has(ALL) && this.say({ type: 'stop' })) this.owed.delete(ALL);
    for (const { number, address } of robots) if (this.owed.has(address) && this.say({ type: 'stop', robot: number })) this.owed.delete(address);
  }

  /** Release one robot, or all robots that this board stopped, so that the pupils can start them again. @param {number} [robot] */
  release(robot) {
    for (const stops of [this.owed, this.said]) for (const address of robot === undefined ? stops : this.meant(robot)) stops.delete(address);
    const released = [...this.robots.values()].filter(({ number, stop_held_by: isHeld }) => (robot === undefined ? isHeld : number === robot));
    this.say({ type: 'release', stops: Object.fromEntries(released.map(({ number, stop_id: stop }) => [number, stop])) });
  }

  /** Return the address of one robot, or the addresses of all robots. @param {number} [robot] */
  meant(robot) {
    const robots = [...this.robots.values()].filter(({ number }) => robot === undefined || number === robot);
    return [...robots.map(({ address }) => address), ...(robot === undefined ? [ALL] : [])];
  }

  /** @param {object} message @returns {boolean} true if it was sent */
  say(message) {
    if (this.socket?.readyState !== 1) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }
}
