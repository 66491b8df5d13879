// Shows the training from recordings: its progress, then a comparison of before and after, and buttons to keep or drop the result.

import { ask } from '../api.js';
import { fill, h, icon } from '../dom.js';
import { count, percent, t } from '../i18n.js';

/** @typedef {import('./recordings.js').Recordings} Recordings */
/** @typedef {{episode_id: string, frame_id: number, label: string, before: string | null, after: string | null}} Difference */

const POLL_MS = 400;

/** @param {Recordings} recordings @param {string[]} episodes */
export async function teachAgain(recordings, episodes) {
  const begun = await recordings.attempt(() => ask('POST', 'api/retraining', { episodes }));
  if (!begun) return;
  draw(recordings, begun);
  recordings.again?.scrollIntoView({ block: 'nearest' });
  recordings.again?.querySelector('button')?.focus();
}

/** Show the state of a training run, if there is one. @param {Recordings} recordings */
export async function showTeaching(recordings) {
  const shown = recordings.again.firstChild;
  const state = await ask('GET', 'api/retraining').catch(() => null);
  if (!recordings.isConnected || recordings.again.firstChild !== shown) return; // another training run has begun, or this run was kept or dropped
  if (state) draw(recordings, state);
  else if (recordings.again.querySelector('progress')) lookAgain(recordings);
}

/** @param {Recordings} recordings */
const lookAgain = (recordings) => setTimeout(() => recordings.isConnected && showTeaching(recordings), POLL_MS);

/** @param {Recordings} recordings @param {any} state */
function draw(recordings, state) {
  const place = /** @type {HTMLElement} */ (recordings.again);
  if (state.state === 'idle') {
    fill(place);
    return;
  }
  if (state.state === 'running') {
    if (!place.querySelector('progress')) {
      fill(place, h('div', { class: 'panel stack' }, h('h3', {}, t('again.running')),
        h('progress', { max: 1, 'aria-label': t('again.running') }),
        h('button', { type: 'button', onclick: () => drop(recordings) }, t('again.drop'))));
    }
    const bar = place.querySelector('progress');
    if (bar) bar.value = state.share;
    lookAgain(recordings);
    return;
  }
  fill(place, state.state === 'failed' ? failure(recordings, state) : outcome(recordings, state));
}

/** @param {Recordings} recordings @param {any} state */
function failure(recordings, state) {
  return h('div', { class: 'panel stack', role: 'status' }, h('p', {}, state.error),
    h('button', { type: 'button', onclick: () => drop(recordings) }, t('close')));
}

/** @param {Recordings} recordings @param {any} state */
function outcome(recordings, { comparison, taught, missing_frames: missing }) {
  const n = Object.values(taught).reduce((a, b) => a + b, 0);
  return h('div', { class: 'panel stack' },
    h('h3', {}, t('again.done', { n: count(n) })),
    missing ? h('p', { class: 'hint' }, t('again.missing', { n: count(missing) })) : null,
    ...(comparison ? sides(comparison) : [h('p', { class: 'hint' }, t('again.too_little'))]),
    h('div', { class: 'row' },
      h('button', { type: 'button', class: 'primary', onclick: () => keep(recordings) }, t('again.keep')),
      h('button', { type: 'button', onclick: () => drop(recordings) }, t('again.drop'))));
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

/** @param {Recordings} recordings */
async function keep(recordings) {
  const kept = await recordings.home.act(() => ask('POST', 'api/retraining/keep', {}));
  if (!kept) return;
  fill(/** @type {Element} */ (recordings.again));
  recordings.page?.toast(t('again.kept', { name: kept.name }));
}

/** @param {Recordings} recordings */
async function drop(recordings) {
  const dropped = await recordings.attempt(() => ask('DELETE', 'api/retraining'));
  if (dropped) fill(/** @type {Element} */ (recordings.again));
}
