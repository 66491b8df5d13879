// <drive-map>: the world from above while the robot drives.
// The map shows the robot's path in amber and blue, and the places where the robot asked for help, pushed against something or was corrected.
// On a phone the map is in a corner of the picture, on a desktop beside the picture.
//
// Only new points of the path are requested, once a second, and only while the map is on the screen.

import { ask } from '../api.js';
import { fill, h, say, svg } from '../dom.js';
import { t } from '../i18n.js';
import { layStops } from '../stop.js';
import { bounds, fetchWorld, makeRobot, mark, room, standAt, way } from './from-above.js';

/** @typedef {import('./from-above.js').World} World */
/** @typedef {{first: number, pose: number[][], driven_by: string[], events: Record<string, string[]>, is_estimate: boolean}} Answer */

const ASK_MS = 1000;
const STAND_MS = 200; // interval at which the robot's symbol moves; a long one, because the browser redraws the map each time
const KINDS = ['asked', 'pushed', 'corrected'];
/** Number of points of the path that the page remembers; the robot remembers as many. */
const POINTS = 2000;
/** Screens with room beside the picture; see drive.css. */
const WIDE = '(min-width: 900px) and (min-height: 701px)';

/** The known part of the robot's path, put together from the robot's answers. */
export class Way {
  constructor() {
    this.first = 0;
    /** @type {number[][]} */
    this.pose = [];
    /** @type {string[]} */
    this.driven_by = [];
    /** @type {{at: number, kind: string}[]} */
    this.events = [];
  }

  /** The number of the next point. */
  get next() {
    return this.first + this.pose.length;
  }

  /** Add the robot's answer to a request for the points since `next`; return false if it has nothing new. @param {Answer} answer */
  add({ first, pose, driven_by: by, events }) {
    const goesOn = first === this.next;
    if (goesOn && !pose.length) return false;
    if (!goesOn) Object.assign(this, { first, pose: [], driven_by: [], events: [] });
    const begin = this.pose.length;
    this.pose.push(...pose);
    this.driven_by.push(...by);
    for (const [index, kinds] of Object.entries(events)) this.events.push(...kinds.map((kind) => ({ at: begin + Number(index), kind })));
    this.forget(this.pose.length - POINTS);
    return true;
  }

  /** Drop the oldest points. @param {number} n */
  forget(n) {
    if (n <= 0) return;
    this.first += n;
    this.pose.splice(0, n);
    this.driven_by.splice(0, n);
    this.events = this.events.flatMap(({ at, kind }) => (at < n ? [] : [{ at: at - n, kind }]));
  }
}

export class DriveMap extends HTMLElement {
  way = new Way();
  isEstimate = false;
  stoodMs = -STAND_MS;

  /** @param {import('../page.js').Page} page */
  start(page) {
    this.page = page;
    this.hidden = true;
    /** @type {World | null} */
    this.world = null;
    this.things = svg('g');
    this.paths = ['pilot', 'robot'].map((who) => svg('path', { class: `way ${who}` }));
    this.marks = svg('g');
    this.robot = makeRobot();
    this.picture = svg('svg', { role: 'img', 'aria-label': t('above.map'), class: 'above' }, svg('g', { transform: 'scale(1 -1)' }, this.things, ...this.paths, this.marks, this.robot));
    this.caption = h('p', { class: 'under' });
    this.append(this.picture, this.caption);
    const wide = matchMedia(WIDE);
    const settle = () => document.querySelector(wide.matches ? 'main#drive' : '.picture')?.append(this);
    wide.addEventListener('change', settle);
    settle();
    page.store.watch(['robot', 'link'], (state) => this.stand(state));
    setInterval(() => this.refresh(), ASK_MS);
  }

  /** @param {import('../store.js').PageState} state */
  stand({ robot, link }) {
    if (link !== 'open' || !robot) return; // without a link, the map does not appear or vanish, so that nothing moves near STOP
    const { pose } = robot;
    if (!pose) {
      this.show(false);
      return;
    }
    const nowMs = performance.now();
    if (!this.hidden && nowMs - this.stoodMs < STAND_MS) return;
    this.stoodMs = nowMs;
    standAt(/** @type {Element} */ (this.robot), [pose.x_m, pose.y_m, pose.heading_rad]);
    if (!this.hidden) return;
    this.show(true);
    this.refresh();
  }

  /** @param {boolean} shown */
  show(shown) {
    if (this.hidden !== shown) return;
    this.hidden = !shown;
    layStops();
  }

  async refresh() {
    const { page, way: known } = this;
    if (this.hidden || this.isAsking || document.hidden || page?.store.state.screen !== 'drive' || !this.getClientRects().length) return;
    this.isAsking = true;
    try {
      /** @type {Answer} */
      const answer = await ask('GET', `api/path?since=${known.next}`);
      const isFirst = !this.picture?.hasAttribute('viewBox');
      const isElsewhere = answer.first !== known.next;
      const isNew = known.add(answer);
      this.isEstimate ||= answer.is_estimate;
      const changes = this.world?.things.some((thing) => thing.moves) && page.store.state.robot?.mode !== 'stopped';
      if (isFirst || isElsewhere || changes) await this.furnish();
      if (isFirst || isNew) this.draw();
    } catch {
      // the robot is out of reach: the request is repeated, and the page reports a lost link
    } finally {
      this.isAsking = false;
    }
  }

  /** Draw the room and the things in it. */
  async furnish() {
    this.world = this.isEstimate ? null : await fetchWorld();
    fill(/** @type {Element} */ (this.things), ...(this.world ? room(this.world) : []));
  }

  draw() {
    const { way: known, picture } = this;
    const here = this.page?.store.state.robot?.pose;
    /** @type {[number, number, number][]} */
    const poses = /** @type {any} */ (known.pose.length || !here ? known.pose : [[here.x_m, here.y_m, 0]]);
    if (!picture || (!poses.length && !this.world)) return;
    const [left, bottom, right, top] = bounds(poses, this.world ?? null);
    picture.setAttribute('viewBox', `${left} ${-top} ${right - left} ${top - bottom}`);
    const path = { pose: poses, driven_by: known.driven_by };
    ['pilot', 'robot'].forEach((who, i) => this.paths?.[i].setAttribute('d', way(path, who)));
    const { events } = known;
    fill(/** @type {Element} */ (this.marks), ...events.map(({ at, kind }) => mark(kind, poses[at][0], poses[at][1])));
    const label = t('above.label', Object.fromEntries(KINDS.map((kind) => [kind, events.filter((event) => event.kind === kind).length])));
    const words = this.isEstimate ? `${t('above.estimate')} ${label}` : label;
    picture.setAttribute('aria-label', `${t('above.map')}. ${words}`);
    say(/** @type {Node} */ (this.caption), words);
  }
}

customElements.define('drive-map', DriveMap);
