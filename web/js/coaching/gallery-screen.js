// <gallery-screen>: shows every learned image; the image that decides the robot's move now is lit.

import { ask } from '../api.js';
import { append, fill, h, icon, say } from '../dom.js';
import { count, language, t } from '../i18n.js';
import { Screen, segments } from '../components/screen.js';
import { byPlace } from '../moves.js';
import { makeNeedle, turnNeedle } from '../needle.js';

/**
 * @typedef {{node: number, votes: Record<string, number>, frames: number, last_used: number,
 *   last_taught: number, taught_at_s: number | null, pinned: boolean, episode?: string | null, angle?: number | null}} LearnedImage
 */

const REFRESH_MS = 1000;
/** @type {Record<string, (a: LearnedImage, b: LearnedImage) => number>} */
const ORDERS = {
  newest: (a, b) => b.last_taught - a.last_taught || b.frames - a.frames,
  used: (a, b) => b.frames - a.frames || b.last_taught - a.last_taught,
};

export class GalleryScreen extends Screen {
  build() {
    this.order = 'newest';
    /** @type {LearnedImage[]} */
    this.images = [];
    /** @type {Map<number, HTMLElement>} */
    this.cards = new Map();
    /** @type {number | null} */
    this.open = null;
    this.summary = h('p', { class: 'lead' });
    this.grid = h('div', { class: 'gallery', role: 'list' });
    this.detail = h('section', { class: 'detail', hidden: true });
    const orders = /** @type {[string, string][]} */ ([['newest', t('gallery.newest')], ['used', t('gallery.used')]]);
    append(this, [this.summary, segments(t('gallery.order'), orders, this.order, (/** @type {string} */ order) => {
      this.order = order;
      this.arrange();
    }), this.grid, this.detail]);
    this.watch(['robot'], ({ robot }) => this.light(robot?.prediction?.node ?? null));
    return this.every(REFRESH_MS, () => this.refresh());
  }

  async refresh() {
    const gallery = await this.inOrder(ask('GET', 'api/gallery'));
    if (!gallery || !this.isConnected) return;
    this.images = gallery.images;
    this.moves = byPlace(gallery.moves);
    const n = gallery.images.length;
    say(/** @type {Node} */ (this.summary),
      n ? t('gallery.summary', { n, max: gallery.max_nodes }) : t('gallery.empty'));
    this.arrange();
    this.renderDetail();
  }

  arrange() {
    const sorted = [...(this.images ?? [])].sort(ORDERS[this.order ?? 'newest']);
    const old = this.cards ?? new Map();
    this.cards = new Map(sorted.map((image) => [image.node, this.card(image, old.get(image.node))]));
    const grid = /** @type {HTMLElement} */ (this.grid);
    const wanted = [...this.cards.values()];
    if (wanted.some((card, i) => grid.children[i] !== card) || grid.children.length !== wanted.length) {
      const focused = document.activeElement;
      grid.replaceChildren(...wanted);
      if (focused instanceof HTMLElement && grid.contains(focused)) focused.focus();
    }
    this.light(this.page?.store.state.robot?.prediction?.node ?? null);
  }

  /** @param {LearnedImage} image @param {HTMLElement | undefined} old */
  card(image, old) {
    const stamp = this.stampOf(image);
    if (old?.dataset.stamp === stamp) return old;
    const card = old ?? h('div', { role: 'listitem' });
    card.dataset.stamp = stamp;
    const main = mainMove(image);
    fill(card, h('button', {
      type: 'button', class: 'card', onclick: () => this.show(image.node),
      'aria-label': t('gallery.card', { move: t(`move.${main}`), n: image.frames }),
    }, this.picture(image), needleOf(image), this.bar(image),
    h('span', { class: 'caption' }, icon(main), count(image.frames), image.pinned ? icon('pin') : null)));
    return card;
  }

  /** @param {LearnedImage | null} image */
  stampOf(image) {
    return `${this.page?.era} ${JSON.stringify(image)}`;
  }

  /** @param {LearnedImage} image */
  picture({ node, frames, votes }) {
    const src = this.page?.imageOf(node, `${frames}.${Object.values(votes).join('.')}`);
    return h('img', { src, alt: '', width: 40, height: 30, loading: 'lazy', class: 'pixels' });
  }

  /** A thin bar that shows the image's votes for left, forward and right by their position. @param {LearnedImage} image */
  bar(image) {
    const bar = h('span', { class: 'bar', 'aria-hidden': 'true' });
    const total = Object.values(image.votes).reduce((a, b) => a + b, 0) || 1;
    for (const move of this.moves ?? []) {
      const part = h('i', { 'data-move': move });
      part.style.transform = `scaleX(${(image.votes[move] ?? 0) / total})`;
      bar.append(part);
    }
    return bar;
  }

  /** @param {number | null} node */
  light(node) {
    for (const [id, card] of this.cards ?? []) card.classList.toggle('lit', id === node);
  }

  /** @param {number | null} node */
  show(node) {
    this.open = node;
    this.renderDetail();
    if (node === null) return;
    this.detail?.querySelector('button')?.focus();
  }

  renderDetail() {
    const detail = /** @type {HTMLElement} */ (this.detail);
    const image = this.images?.find(({ node }) => node === this.open);
    detail.hidden = !image;
    const stamp = this.stampOf(image ?? null);
    if (!image || detail.dataset.stamp === stamp) return;
    const focused = detail.contains(document.activeElement) &&
      [...detail.querySelectorAll('button')].indexOf(/** @type {HTMLButtonElement} */ (document.activeElement));
    detail.dataset.stamp = stamp;
    fill(detail,
      h('div', { class: 'head' }, h('h2', {}, t('gallery.image', { move: t(`move.${mainMove(image)}`) })),
        h('button', { type: 'button', class: 'quiet', onclick: () => this.show(null) }, t('close'))),
      h('div', { class: 'facts-row' }, this.picture(image), h('ul', {}, ...this.facts(image))),
      h('p', { class: 'hint' }, t('gallery.relabel')),
      h('div', { class: 'row' }, ...(this.moves ?? []).map((move) => this.label(image, move))),
      h('div', { class: 'row' },
        h('button', { type: 'button', 'aria-pressed': String(image.pinned), onclick: () => this.edit('pin', !image.pinned) },
          icon('pin'), t(image.pinned ? 'gallery.unpin' : 'gallery.pin')),
        h('button', { type: 'button', disabled: image.pinned, onclick: () => this.edit('delete') }, t('delete'))));
    if (typeof focused === 'number') detail.querySelectorAll('button')[focused]?.focus();
  }

  /** @param {LearnedImage} image */
  facts(image) {
    const at = image.taught_at_s === null ? null : new Date(image.taught_at_s * 1000).toLocaleTimeString(language);
    return [
      h('li', {}, t('gallery.frames', { n: count(image.frames) })),
      ...(this.moves ?? []).filter((move) => image.votes[move])
        .map((move) => h('li', {}, `${t(`move.${move}`)}: ${count(image.votes[move])}`)),
      image.angle == null ? null : h('li', {}, `${t('needle')}: ${t('needle.taught', { n: Math.round(100 * image.angle) })}`),
      image.last_taught ? h('li', {}, t(at ? 'gallery.taught_at' : 'gallery.taught', { at: at ?? '', n: count(image.last_taught) })) : null,
      image.episode ? h('li', {}, t('gallery.episode', { name: image.episode })) : null,
    ].filter((fact) => fact !== null);
  }

  /** @param {LearnedImage} image @param {string} move */
  label(image, move) {
    return h('button', {
      type: 'button', 'aria-pressed': String(mainMove(image) === move), 'data-move': move,
      onclick: () => this.edit('relabel', move),
    }, icon(move), t(`move.${move}`));
  }

  /** @param {string} verb @param {unknown} [value] */
  async edit(verb, value) {
    const node = this.open;
    await this.attempt(async () => {
      await ask('POST', `api/gallery/${node}`, { verb, value });
      this.page?.toast(t(`gallery.done.${verb}`), { label: t('undo'), act: () => this.undo() });
      if (verb === 'delete') this.open = null;
      await this.refresh();
    });
  }

  async undo() {
    await this.attempt(async () => {
      await ask('POST', 'api/gallery/undo');
      await this.refresh();
    });
  }
}

/** @param {Pick<LearnedImage, 'votes'>} image */
export function mainMove({ votes }) {
  return Object.entries(votes).reduce((a, b) => (b[1] > a[1] ? b : a), ['stop', 0])[0];
}

/** The mean steering of the image's frames; null if they were driven by moves. @param {LearnedImage} image */
function needleOf({ angle }) {
  if (angle == null) return null;
  const needle = makeNeedle();
  turnNeedle(needle, { taught: angle });
  return needle;
}

customElements.define('gallery-screen', GalleryScreen);
