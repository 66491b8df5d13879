// Mending a recording: pilot and robot along the time axis, a range, and what to do with it.

import { ask } from '../api.js';
import { append, fill, h, icon, say, svg } from '../dom.js';
import { count, t } from '../i18n.js';
import { byPlace, declare } from '../moves.js';

/** @typedef {import('./home-screen.js').HomeScreen} Home */
/** @typedef {{frame: number[], at_s: number[], label: (string | null)[], predicted: (string | null)[], deleted: boolean[]}} Columns */

const LANE_PX = 12;

/** @param {Home} home @param {string} path  of the episode @param {Element} place  filled with the tools */
export async function mend(home, path, place) {
  const shown = await home.attempt(() => Promise.all([ask('GET', path), ask('GET', `${path}/timeline`)]));
  if (!shown || !place.isConnected) return;
  const [episode, { columns }] = /** @type {[any, {columns: Columns}]} */ (shown);
  declare(episode.declared_moves ?? []);
  const lanes = byPlace(episode.moves);
  const height = LANE_PX * 2 * lanes.length + 6;
  const last = columns.frame.length - 1;
  if (last < 1) return;
  const range = [0, last];
  const words = h('p', { class: 'under', role: 'status' });
  const window_ = svg('rect', { y: 0, height, class: 'range' });
  const views = range.map(() => h('img', { class: 'pixels', width: 40, height: 30, alt: '' }));
  const tell = () => {
    const [from, to] = range;
    window_.setAttribute('x', String(from));
    window_.setAttribute('width', String(to - from + 1));
    say(words, t('mend.range', { from: columns.at_s[from].toFixed(1), to: columns.at_s[to].toFixed(1), n: count(to - from + 1) }));
  };
  const look = (/** @type {number} */ end) => { views[end].src = `${path}/frames/${columns.frame[range[end]]}`; };
  const sliders = [t('mend.from'), t('mend.to')].map((label, end) => {
    const input = h('input', { type: 'range', min: 0, max: last, value: range[end], 'aria-label': label, onchange: () => look(end) });
    input.addEventListener('input', () => {
      range[end] = end ? Math.max(Number(input.value), range[0]) : Math.min(Number(input.value), range[1]);
      input.value = String(range[end]);
      tell();
    });
    return h('div', { class: 'facts-row' }, views[end], input);
  });
  const change = (/** @type {() => Promise<unknown>} */ act) => home.attempt(act).then(() => mend(home, path, place));
  const edit = (/** @type {string} */ verb, /** @type {string} */ label = '') => change(() =>
    ask('POST', `${path}/edits`, { verb, first: columns.frame[range[0]], last: columns.frame[range[1]], label }));
  const button = (/** @type {string} */ text, /** @type {() => unknown} */ act, /** @type {Node | null} */ sign = null) =>
    h('button', { type: 'button', onclick: act }, sign, text);
  fill(place, timeline(columns, window_, lanes), words, ...sliders,
    h('div', { class: 'row' }, button(t('mend.keep'), () => edit('trim')), button(t('mend.delete'), () => edit('delete'))),
    h('div', { class: 'row' }, h('span', { class: 'hint' }, t('mend.label')),
      ...episode.moves.map((/** @type {string} */ move) => button(t(`move.${move}`), () => edit('relabel', move), icon(move)))),
    episode.edit_list.length
      ? button(t('mend.undo', { n: count(episode.edit_list.length) }), () => change(() => ask('DELETE', `${path}/edits/last`)), icon('undo'))
      : null);
  tell();
  look(0);
  look(1);
}

/** Each move has a lane of its own, so that it is told by place. @param {Columns} columns @param {SVGElement} window_ @param {string[]} lanes */
function timeline(columns, window_, lanes) {
  const size = columns.frame.length;
  const half = LANE_PX * lanes.length;
  const picture = svg('svg', { viewBox: `0 0 ${size} ${2 * half + 6}`, preserveAspectRatio: 'none', role: 'img', class: 'timeline', 'aria-label': t('mend.chart') });
  append(picture, [window_,
    path(columns.label, columns.deleted, lanes, 0, 'you'),
    path(columns.predicted, columns.deleted, lanes, half + 6, 'robot')]);
  return h('div', { class: 'stack' }, h('div', { class: 'under' }, icon('pilot'), t('mend.pilot')), picture,
    h('div', { class: 'under' }, icon('robot'), t('mend.robot')));
}

/** @param {(string | null)[]} moves @param {boolean[]} deleted @param {string[]} lanes @param {number} top @param {string} kind */
function path(moves, deleted, lanes, top, kind) {
  let outline = '';
  for (let begin = 0, end = 0; begin < moves.length; begin = end) {
    while (end < moves.length && moves[end] === moves[begin] && deleted[end] === deleted[begin]) end += 1;
    const move = moves[begin];
    if (!move || deleted[begin]) continue;
    const lane = lanes.indexOf(move);
    if (lane >= 0) outline += `M${begin} ${top + lane * LANE_PX + 2}h${end - begin}v${LANE_PX - 4}h${begin - end}z`;
  }
  return svg('path', { d: outline, class: kind });
}
