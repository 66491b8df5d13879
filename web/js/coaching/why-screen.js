// <why-screen>: the screen "Why?" explains the robot's current proposal.
// The screen shows the robot's current picture, and the learned image that decides.
// The areas in which the image and the picture are most alike are marked.

import { ask } from '../api.js';
import { append, fill, h, icon, say, svg } from '../dom.js';
import { count, t } from '../i18n.js';
import { byPlace } from '../moves.js';
import { mainMove } from './gallery-screen.js';
import { Screen } from '../components/screen.js';

const REFRESH_MS = 500;
const DARKEST = 0.55; // opacity of the dark areas, in which the two pictures differ
const MARKED = 0.5; // an area is framed if its similarity is at least this share of the greatest similarity
const [WIDTH, HEIGHT] = [40, 30];

/**
 * @typedef {{frame: number, action: string | null, novelty: number, node: number, votes: Record<string, number>,
 *   frames: number, present: string, image: string, alike: number[][]}} Why
 */

export class WhyScreen extends Screen {
  build() {
    this.words = h('p', { class: 'lead', role: 'status' });
    this.pair = h('div', { class: 'pair' });
    this.facts = h('ul');
    this.more = h('p', { class: 'hint' }, t('why.how'));
    append(this, [this.words, this.pair, this.more, this.facts, h('a', { class: 'button', href: '#gallery' }, t('screen.gallery'))]);
    return this.every(REFRESH_MS, () => this.refresh());
  }

  async refresh() {
    const frame = this.page?.store.state.robot?.frame;
    if (document.hidden || (frame !== undefined && frame === this.drawn)) return;
    const answer = await ask('GET', 'api/why').catch(() => null);
    if (answer && this.isConnected) this.render(answer.why);
  }

  /** @param {Why | null} why */
  render(why) {
    const nothing = !why;
    for (const part of [this.pair, this.facts, this.more]) /** @type {HTMLElement} */ (part).hidden = nothing;
    if (!why) {
      say(/** @type {Node} */ (this.words), t('why.nothing'));
      return;
    }
    this.drawn = why.frame;
    const main = mainMove(why);
    say(/** @type {Node} */ (this.words), sentence(why, main));
    fill(/** @type {Element} */ (this.pair),
      view(why.present, why.alike, t('why.present'), null),
      view(why.image, why.alike, t('why.image'), main));
    const total = Object.values(why.votes).reduce((sum, n) => sum + n, 0) || 1;
    fill(/** @type {Element} */ (this.facts), h('li', {}, t('gallery.frames', { n: count(why.frames) })),
      ...byPlace(Object.keys(why.votes)).filter((move) => why.votes[move])
        .map((move) => h('li', {}, `${t(`move.${move}`)}: ${count(why.votes[move])} (${Math.round((100 * why.votes[move]) / total)} %)`)));
  }
}

/** @param {Why} why @param {string} main  the move that has the most votes in the image */
function sentence({ action, novelty }, main) {
  if (!action) return t('why.nothing');
  const values = { move: t(`move.${action}`), image: t(`move.${main}`) };
  if (novelty >= 1) return t('why.unknown', values);
  return t(action === main ? 'why.because' : 'why.although', values);
}

/** One of the two pictures, darkened in areas that are not alike. @param {string} png @param {number[][]} alike @param {string} title @param {string | null} move */
function view(png, alike, title, move) {
  const wide = WIDTH / alike[0].length;
  const high = HEIGHT / alike.length;
  const most = Math.max(...alike.flat()) || 1;
  const shades = alike.flatMap((row, r) => row.map((share, c) => svg('rect', {
    x: c * wide, y: r * high, width: wide, height: high, class: share >= MARKED * most && share > 0 ? 'marked' : '',
    'fill-opacity': (DARKEST * (1 - share / most)).toFixed(2),
  })));
  const picture = svg('svg', { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: 'img', 'aria-label': title, class: 'alike' },
    svg('image', { href: `data:image/png;base64,${png}`, width: WIDTH, height: HEIGHT }), ...shades);
  return h('figure', {}, /** @type {any} */ (picture), h('figcaption', {}, move ? icon(move) : null, move ? `${title} · ${t(`move.${move}`)}` : title));
}

customElements.define('why-screen', WhyScreen);
