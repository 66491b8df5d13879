// Training again from recordings: progress, then a comparison of before and after, then keep or drop.

import { ask } from '../api.js';
import { fill, h, icon } from '../dom.js';
import { count, percent, t } from '../i18n.js';

/** @typedef {import('./home-screen.js').HomeScreen} Home */
/** @typedef {{episode_id: string, frame_id: number, label: string, before: string | null, after: string | null}} Difference */

const POLL_MS = 400;

/** @param {Home} home @param {string[]} episodes */
export async function teachAgain(home, episodes) {
  const begun = await home.attempt(() => ask('POST', 'api/retraining', { episodes }));
  if (!begun) return;
  draw(home, begun);
  home.again?.scrollIntoView({ block: 'nearest' });
  home.again?.querySelector('button')?.focus();
}

/** Show the state of a training run, if there is one. @param {Home} home */
export async function showTeaching(home) {
  const shown = home.again.firstChild;
  const state = await ask('GET', 'api/retraining').catch(() => null);
  if (!home.isConnected || home.again.firstChild !== shown) return; // begun, kept or dropped meanwhile
  if (state) draw(home, state);
  else if (home.again.querySelector('progress')) lookAgain(home);
}

/** @param {Home} home */
const lookAgain = (home) => setTimeout(() => home.isConnected && showTeaching(home), POLL_MS);

/** @param {Home} home @param {any} state */
function draw(home, state) {
  const place = /** @type {HTMLElement} */ (home.again);
  if (state.state === 'idle') {
    fill(place);
    return;
  }
  if (state.state === 'running') {
    if (!place.querySelector('progress')) {
      fill(place, h('div', { class: 'panel stack' }, h('h3', {}, t('again.running')),
        h('progress', { max: 1, 'aria-label': t('again.running') }),
        h('button', { type: 'button', onclick: () => drop(home) }, t('again.drop'))));
    }
    const bar = place.querySelector('progress');
    if (bar) bar.value = state.share;
    lookAgain(home);
    return;
  }
  fill(place, state.state === 'failed' ? failure(home, state) : outcome(home, state));
}

/** @param {Home} home @param {any} state */
function failure(home, state) {
  return h('div', { class: 'panel stack', role: 'status' }, h('p', {}, state.error),
    h('button', { type: 'button', onclick: () => drop(home) }, t('close')));
}

/** @param {Home} home @param {any} state */
function outcome(home, { comparison, taught, missing_frames: missing }) {
  const n = Object.values(taught).reduce((a, b) => a + b, 0);
  return h('div', { class: 'panel stack' },
    h('h3', {}, t('again.done', { n: count(n) })),
    missing ? h('p', { class: 'hint' }, t('again.missing', { n: count(missing) })) : null,
    ...(comparison ? sides(comparison) : [h('p', { class: 'hint' }, t('again.too_little'))]),
    h('div', { class: 'row' },
      h('button', { type: 'button', class: 'primary', onclick: () => keep(home) }, t('again.keep')),
      h('button', { type: 'button', onclick: () => drop(home) }, t('again.drop'))));
}

/** @param {{frames: number, before: number, after: number, mended: Difference[], broken: Difference[]}} comparison */
function sides({ frames, before, after, mended, broken }) {
  const side = (/** @type {string} */ key, /** @type {number} */ share) =>
    h('div', { class: 'big' }, h('strong', {}, percent(share)), h('small', {}, t(key)));
  return [
    h('div', { class: 'sides', role: 'status' }, side('again.before', before), side('again.after', after)),
    h('p', { class: 'hint' }, t('again.how', { n: count(frames) })),
    ...strip('again.mended', mended), ...strip('again.broken', broken),
  ];
}

/** @param {string} title @param {Difference[]} differences */
function strip(title, differences) {
  if (!differences.length) return [];
  const name = (/** @type {string | null} */ move) => (move ? t(`move.${move}`) : '–');
  return [h('h3', {}, t(title)), h('div', { class: 'strip', role: 'list' }, ...differences.map((d) =>
    h('div', { role: 'listitem' },
      h('img', { alt: '', width: 84, height: 63, loading: 'lazy', src: `api/episodes/${encodeURIComponent(d.episode_id)}/frames/${d.frame_id}` }),
      h('span', { class: 'under' }, `${name(d.before)} → ${name(d.after)}`),
      h('span', { class: 'under' }, icon('pilot'), name(d.label)))))];
}

/** @param {Home} home */
async function keep(home) {
  const kept = await home.act(() => ask('POST', 'api/retraining/keep', {}));
  if (!kept) return;
  fill(/** @type {Element} */ (home.again));
  home.page?.toast(t('again.kept', { name: kept.name }));
}

/** @param {Home} home */
async function drop(home) {
  const dropped = await home.attempt(() => ask('DELETE', 'api/retraining'));
  if (dropped) fill(/** @type {Element} */ (home.again));
}
