// A recording's player, with tools to edit parts of the recording.
// One time axis shows the held moves, the robot's proposals and the sonar.

import { ask, askLong, inOrder } from '../api.js';
import { append, fill, h, icon, say, settle, svg } from '../dom.js';
import { count, t } from '../i18n.js';
import { drawFromAbove } from '../components/from-above.js';
import { listEpisodes } from './episode-list.js';

/** @typedef {import('./recordings.js').Recordings} Recordings */
/**
 * @typedef {{frame: number[], at_s: number[], label: (string | null)[], predicted: (string | null)[], deleted: boolean[],
 *   driven_by: (string | null)[], asks_pilot: boolean[], intervention: boolean[], bumped: boolean[],
 *   distance_m: (number | null)[], pose: ([number, number, number] | null)[]}} Columns
 */

const LANES = ['left', 'forward', 'right'];
const LANE_PX = 12;
const SONAR_PX = 30;
const HEIGHT = LANE_PX * 6 + 12 + SONAR_PX;
const FARTHEST_M = 2;
const LEAST_MS = 80; // minimum time between two pictures while playing, so that every phone can keep up
const [MOST_FRAMES, FEW_FRAMES] = [10_000, 500]; // if a recording has more than MOST_FRAMES, only FEW_FRAMES evenly spaced pictures are shown

/** The address of a recording's timeline, or of its part between two pictures. If the timeline is long, the robot returns only a sample of it. @param {string} path @param {number} frames @param {number[]} between */
export const timelineOf = (path, frames, between = []) =>
  `${path}/timeline?count=${frames > MOST_FRAMES ? FEW_FRAMES : MOST_FRAMES}${between.length ? `&first=${between[0]}&last=${between[1]}` : ''}`;

/** @param {Recordings} recordings @param {string} path  of the episode @param {Element} place  filled with the tools @param {() => void} teach @param {number[]} between  the first and the last picture; empty: the whole recording */
export async function openPlayer(recordings, path, place, teach, at = 0, ordered = inOrder(), between = []) {
  const shown = await ordered(recordings.attempt(async () => {
    const episode = await askLong(path);
    const asked = between.length ? between[1] - between[0] + 1 : episode.frames;
    const { columns, is_estimate: isEstimate } = await askLong(timelineOf(path, asked, between));
    const player = new Player(columns, path, columns.frame.length < asked);
    await drawFromAbove(player.map, columns, isEstimate);
    return { episode, player };
  }));
  if (!shown || !recordings.isConnected) return;
  const { episode, player } = /** @type {{episode: any, player: Player}} */ (shown);
  const { columns, last, range } = player;
  if (last < 1) return;
  const change = (/** @type {() => Promise<unknown>} */ act) =>
    recordings.attempt(act).then(() => { player.stop(); openPlayer(recordings, path, place, teach, player.now, ordered, between); });
  const edit = (/** @type {string} */ verb, /** @type {string} */ label = '') => change(() =>
    ask('POST', `${path}/edits`, { verb, first: columns.frame[range[0]], last: columns.frame[range[1]], label }));
  const button = (/** @type {string} */ text, /** @type {() => unknown} */ act, /** @type {Node | null} */ sign = null) =>
    h('button', { type: 'button', onclick: act }, sign, text);
  const split = async () => {
    await recordings.attempt(() => ask('POST', `${path}/split`, { frame: columns.frame[player.now] }));
    await listEpisodes(recordings);
  };
  const look = (/** @type {number[]} */ part) => { player.stop(); openPlayer(recordings, path, place, teach, 0, ordered, part); };
  const view = player.build();
  player.show(Math.min(at, last));
  fill(place, view,
    h('div', { class: 'row' }, button(t('mend.keep'), () => edit('trim')), button(t('mend.delete'), () => edit('delete')),
      button(t('mend.split'), split),
      player.isSampled ? button(t('mend.closer'), () => look(range.map((end) => columns.frame[end]))) : null,
      between.length ? button(t('mend.whole'), () => look([])) : null),
    h('div', { class: 'row', role: 'group', 'aria-label': t('mend.label') }, h('span', { class: 'hint' }, t('mend.label')),
      ...episode.moves.map((/** @type {string} */ move) => button(t(`move.${move}`), () => edit('relabel', move), icon(move)))),
    h('div', { class: 'row' },
      episode.edit_list.length
        ? button(t('mend.undo', { n: count(episode.edit_list.length) }), () => change(() => ask('DELETE', `${path}/edits/last`)), icon('undo'))
        : null,
      episode.redoable ? button(t('mend.redo'), () => change(() => ask('POST', `${path}/edits/redo`)), icon('redo')) : null),
    h('button', { type: 'button', class: 'primary', onclick: teach }, t('again.begin')));
  settle(place); // ignore further taps, because *Delete* would now delete the whole recording
}

class Player {
  /** @param {Columns} columns @param {string} path @param {boolean} isSampled */
  constructor(columns, path, isSampled) {
    this.columns = columns;
    this.isSampled = isSampled;
    this.path = path;
    this.last = columns.frame.length - 1;
    this.range = [0, this.last];
    this.now = 0;
    this.isPlaying = false;
    this.picture = h('img', { class: 'recorded', width: 320, height: 240, alt: '' });
    this.caption = h('p', { class: 'under' });
    this.words = h('p', { class: 'under', role: 'status' });
    this.map = h('div', { class: 'map' });
  }

  build() {
    const { last, range } = this;
    this.window = svg('rect', { y: 0, height: HEIGHT, class: 'range' });
    this.head = svg('rect', { y: 0, height: HEIGHT, class: 'head', width: Math.max(1, last / 250) });
    this.play = h('button', { type: 'button', class: 'play', onclick: () => this.toggle() });
    this.scrub = h('input', { type: 'range', min: 0, max: last, value: 0, 'aria-label': t('mend.time'), oninput: () => this.seek(Number(this.scrub?.value)) });
    this.views = range.map(() => h('img', { class: 'pixels', width: 40, height: 30, alt: '' }));
    this.sliders = [t('mend.from'), t('mend.to')].map((label, end) => {
      const input = h('input', { type: 'range', min: 0, max: last, value: range[end], 'aria-label': label, onchange: () => this.look(end) });
      input.addEventListener('input', () => this.mark(end, Number(input.value)));
      return input;
    });
    const here = [t('mend.from_here'), t('mend.to_here')].map((text, end) =>
      h('button', { type: 'button', onclick: () => { this.mark(end, this.now); this.look(end); } }, text));
    const box = h('div', { class: 'player stack', role: 'group', 'aria-label': t('mend.player'), tabindex: 0, onkeydown: (/** @type {KeyboardEvent} */ event) => this.key(event) },
      h('div', { class: 'seen' }, h('div', {}, this.picture, this.caption), this.map), this.timeline(),
      h('div', { class: 'facts-row' }, this.play, this.scrub),
      this.words,
      ...[0, 1].map((end) => h('div', { class: 'facts-row' }, this.views?.[end], this.sliders?.[end], here[end])));
    this.face();
    this.tell();
    this.look(0);
    this.look(1);
    return box;
  }

  /** Draw the time axis. Each move has its own lane, so that its height shows which move it is; the sonar is below. */
  timeline() {
    const { columns } = this;
    const size = columns.frame.length;
    const picture = svg('svg', { viewBox: `0 0 ${size} ${HEIGHT}`, preserveAspectRatio: 'none', role: 'img', class: 'timeline', 'aria-label': t('mend.chart') });
    append(picture, [/** @type {SVGElement} */ (this.window),
      lanes(columns.label, columns.deleted, 0, 'you'),
      lanes(columns.predicted, columns.deleted, LANE_PX * 3 + 6, 'robot'),
      sonar(columns.distance_m), /** @type {SVGElement} */ (this.head)]);
    picture.addEventListener('pointerdown', (event) => {
      const box = picture.getBoundingClientRect();
      this.seek(Math.round(((/** @type {PointerEvent} */ (event).clientX - box.left) / box.width) * this.last));
    });
    return h('div', { class: 'stack tight' }, h('div', { class: 'under' }, icon('pilot'), t('mend.pilot')), picture,
      h('div', { class: 'under' }, icon('robot'), t('mend.robot'), ' · ', t('mend.sonar')));
  }

  /** @param {number} end @param {number} value */
  mark(end, value) {
    const { range } = this;
    range[end] = end ? Math.max(value, range[0]) : Math.min(value, range[1]);
    /** @type {HTMLInputElement[]} */ (this.sliders)[end].value = String(range[end]);
    this.tell();
  }

  tell() {
    const [from, to] = this.range;
    const { at_s: at, frame } = this.columns;
    const n = this.isSampled ? frame[to] - frame[from] + 1 : to - from + 1;
    this.window?.setAttribute('x', String(from));
    this.window?.setAttribute('width', String(to - from + 1));
    this.sliders?.forEach((slider, end) => slider.setAttribute('aria-valuetext', `${at[this.range[end]].toFixed(1)} s`));
    say(this.words, t('mend.range', { from: at[from].toFixed(1), to: at[to].toFixed(1), n: count(n) }));
  }

  /** @param {number} end */
  look(end) {
    /** @type {HTMLImageElement[]} */ (this.views)[end].src = this.source(this.range[end]);
  }

  /** @param {number} index */
  source(index) {
    return `${this.path}/frames/${this.columns.frame[index]}`;
  }

  /** @param {number} index */
  seek(index) {
    this.stop();
    this.show(Math.max(0, Math.min(index, this.last)));
  }

  /** @param {number} index */
  show(index) {
    const { columns } = this;
    this.now = index;
    this.picture.src = this.source(index);
    if (this.scrub) this.scrub.value = String(index);
    this.head?.setAttribute('x', String(index));
    const [held, proposed, far] = [columns.label[index], columns.predicted[index], columns.distance_m[index]];
    say(this.caption, [`${columns.at_s[index].toFixed(1)} s`, `${t('mend.pilot')}: ${held ? t(`move.${held}`) : '–'}`,
      `${t('mend.robot')}: ${proposed ? t(`move.${proposed}`) : '–'}`, far == null ? '' : t('distance', { cm: Math.round(far * 100) })].filter(Boolean).join(' · '));
    this.scrub?.setAttribute('aria-valuetext', this.caption.textContent ?? '');
    this.map.dispatchEvent(new CustomEvent('moment', { detail: index }));
  }

  face() {
    const button = /** @type {HTMLElement} */ (this.play);
    button.setAttribute('aria-label', t(this.isPlaying ? 'mend.pause' : 'mend.play'));
    fill(button, icon(this.isPlaying ? 'nobody' : 'play'));
  }

  toggle() {
    if (this.isPlaying) {
      this.stop();
      return;
    }
    if (this.now >= this.last) this.show(0);
    this.isPlaying = true;
    this.face();
    const { at_s: at } = this.columns;
    const startedMs = performance.now() - at[this.now] * 1000;
    let drawnMs = -Infinity;
    const step = (/** @type {number} */ nowMs) => {
      if (!this.isPlaying || !this.picture.isConnected) return;
      let index = this.now;
      while (index < this.last && at[index + 1] * 1000 <= nowMs - startedMs) index += 1;
      if (index !== this.now && (nowMs - drawnMs >= LEAST_MS || index === this.last)) {
        drawnMs = nowMs;
        this.show(index);
      }
      if (index >= this.last) this.stop();
      else requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  stop() {
    this.isPlaying = false;
    if (this.play) this.face();
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    const isControl = event.target instanceof HTMLElement && event.target.matches('button, input');
    /** @type {Record<string, () => void>} */
    const keys = {
      i: () => { this.mark(0, this.now); this.look(0); },
      o: () => { this.mark(1, this.now); this.look(1); },
      ...(isControl ? {} : { ' ': () => this.toggle(), ArrowLeft: () => this.seek(this.now - 1), ArrowRight: () => this.seek(this.now + 1) }),
    };
    if (!(event.key in keys) || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    keys[event.key]();
  }
}

/** @param {(string | null)[]} moves @param {boolean[]} deleted @param {number} top @param {string} kind */
function lanes(moves, deleted, top, kind) {
  let outline = '';
  for (let begin = 0, end = 0; begin < moves.length; begin = end) {
    while (end < moves.length && moves[end] === moves[begin] && deleted[end] === deleted[begin]) end += 1;
    const move = moves[begin];
    if (!move || deleted[begin]) continue;
    const lane = LANES.findIndex((name) => move.endsWith(name));
    outline += `M${begin} ${top + (lane < 0 ? 1 : lane) * LANE_PX + 2}h${end - begin}v${LANE_PX - 4}h${begin - end}z`;
  }
  return svg('path', { d: outline, class: kind });
}

/** @param {(number | null)[]} distances */
function sonar(distances) {
  const top = HEIGHT - SONAR_PX;
  const points = distances.flatMap((far, i) => (far == null ? [] : [`${i},${(top + SONAR_PX * (1 - Math.min(far, FARTHEST_M) / FARTHEST_M)).toFixed(1)}`]));
  return svg('polyline', { points: points.join(' '), class: 'sonar' });
}
