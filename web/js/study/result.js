// Shows how similarly pilot and robot have driven: a number, a chart for each move, and the path from above.

import { askLong } from '../api.js';
import { drawFromAbove } from '../components/from-above.js';
import { text } from '../components/screen.js';
import { h, icon, svg } from '../dom.js';
import { count, t } from '../i18n.js';

/** @typedef {{moves: string[], examples: number, interventions: number, recordings: string[], step_m: number, ssd: number | null,
 *   pilot: Record<string, number[]>, robot: Record<string, number[]>, ssd_per_move: Record<string, number>,
 *   never_by_pilot: string[], never_by_robot: string[]}} Outcome */

const WIDTH = 340;
const HEIGHT = 200;
const FAR_M = 2;
const WHO = /** @type {const} */ (['pilot', 'robot']);

/** @param {Outcome} outcome @returns {HTMLElement[]} */
export function drawOutcome(outcome) {
  const { ssd } = outcome;
  // The map is at the end, because the page loads it last.
  const map = h('figure', { class: 'panel chart map' });
  drawRecordings(map, outcome.recordings).catch(() => {}); // if the recordings cannot be read, there is no path to draw
  return [
    h('p', { class: 'lead' }, ssd === null ? t('study.no_profile') : t('study.ssd', { ssd: ssd.toFixed(2) })),
    h('div', { class: 'profiles' }, ...outcome.moves.map((move) => profile(outcome, move))),
    h('p', { class: 'hint' }, t('study.profile_how')),
    h('p', {}, t('study.facts', { n: count(outcome.examples), i: count(outcome.interventions) })),
    map,
  ];
}

/** Draw the paths of some recordings, one after the other; deleted recordings are left out. @param {HTMLElement} place @param {string[]} ids */
async function drawRecordings(place, ids) {
  const kept = new Set((await askLong('api/episodes').catch(() => ({ episodes: [] }))).episodes.map((/** @type {{id: string}} */ { id }) => id));
  const parts = await Promise.all(ids.filter((id) => kept.has(id)).map((id) => askLong(`api/episodes/${id}/timeline?count=2000`)));
  /** @type {import('../components/from-above.js').Path} */
  const path = { pose: [], driven_by: [], asks_pilot: [], intervention: [], bumped: [] };
  for (const { columns } of parts) {
    for (const [name, list] of /** @type {[keyof import('../components/from-above.js').Path, any[]][]} */ (Object.entries(path))) list.push(...columns[name], null);
  }
  await drawFromAbove(place, path, parts.some((part) => part.is_estimate));
  place.dispatchEvent(new CustomEvent('moment', { detail: path.pose.length - 2 }));
}

/** Draw the curves of one move: at each distance, the share of the move's ticks in which something was nearer than that. @param {Outcome} outcome @param {string} move */
function profile(outcome, move) {
  const x = (/** @type {number} */ m) => 40 + (m / FAR_M) * (WIDTH - 56);
  const y = (/** @type {number} */ share) => 12 + (1 - share) * (HEIGHT - 44);
  const curves = WHO.map((who) => {
    const shares = (outcome[who][move] ?? []).slice(0, Math.round(FAR_M / outcome.step_m) + 1);
    return svg('polyline', { class: `curve ${who}`, points: shares.map((p, i) => `${x(i * outcome.step_m).toFixed(1)},${y(p).toFixed(1)}`).join(' ') });
  });
  const grid = [0, 0.5, 1].flatMap((share) => [svg('line', { class: 'grid', x1: 40, x2: WIDTH - 16, y1: y(share), y2: y(share) }), text(34, y(share) + 5, 'end', String(share))]);
  const metres = [0, 0.5, 1, 1.5, 2].map((m) => text(x(m), HEIGHT - 10, 'middle', m === FAR_M ? `${m} m` : String(m)));
  const label = t('study.chart', { move: t(`move.${move}`), ssd: (outcome.ssd_per_move[move] ?? 0).toFixed(2) });
  const never = WHO.filter((who) => outcome[`never_by_${who}`].includes(move));
  return h('figure', { class: 'panel chart' },
    h('figcaption', {}, icon(move), h('b', {}, t(`move.${move}`)), ...WHO.map((who) => h('span', { class: `key ${who}` }, t(`study.${who}`)))),
    /** @type {any} */ (svg('svg', { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: 'img', 'aria-label': label }, ...grid, ...metres, ...curves)),
    ...never.map((who) => h('p', { class: 'hint' }, t(`study.never_${who}`))));
}
