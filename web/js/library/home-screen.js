// <home-screen>: the models saved on this robot; other extensions add parts, such as recordings.

import { ask } from '../api.js';
import { append, fill, h, icon } from '../dom.js';
import { count, language, t } from '../i18n.js';
import { Screen, contentOf } from '../components/screen.js';
import { sectionsOf } from '../parts.js';

/**
 * @typedef {{name: string, current: boolean, bytes: number, readable: boolean, place: string,
 *   saved_at_s: number | null, learner: string | null, moves: string[],
 *   taught: Record<string, number>, lessons: number, nodes: number}} Model
 */

/** A new model can begin with the weights of earlier models that have at least this number of examples. */
const ENOUGH = 300;
const MOST = 8;

export class HomeScreen extends Screen {
  build() {
    /** @type {string | null} */
    this.open = null;
    /** @type {Model[]} */
    this.known = [];
    this.models = h('div', { class: 'stack', role: 'list' });
    const file = h('input', { type: 'file', accept: '.npz', hidden: true,
      onchange: () => {
        const [chosen] = file.files ?? [];
        file.value = ''; // otherwise the same file could not be chosen again
        if (chosen) this.upload(chosen);
      } });
    this.alike = h('input', { type: 'checkbox' });
    this.like = h('label', { class: 'choice', hidden: true }, this.alike, h('span', {}, t('home.like')));
    append(this, [
      h('h2', {}, t('home.models')), this.models, this.like,
      h('div', { class: 'row' },
        h('button', { type: 'button', onclick: () => this.begin() }, t('home.begin')),
        h('button', { type: 'button', onclick: () => file.click() }, t('home.upload')), file),
    ]);
    return Promise.all([this.refresh(), sectionsOf('home', this).then((sections) => append(this, sections))]);
  }

  async refresh() {
    const answer = await this.inOrder(this.attempt(() => ask('GET', 'api/models')));
    if (!answer || !this.isConnected) return;
    this.known = /** @type {any} */ (answer).models;
    this.draw();
  }

  draw() {
    /** @type {HTMLElement} */ (this.like).hidden = !this.earlier().length;
    fill(/** @type {Element} */ (this.models),
      ...(this.known?.length ? this.known.map((model) => this.card(model)) : [h('p', { class: 'hint', role: 'listitem' }, t('home.none'))]));
  }

  /** @param {Model} model */
  card(model) {
    const { name, current } = model;
    const isOpen = this.open === name;
    const preview = model.nodes
      ? h('img', { class: 'pixels', width: 40, height: 30, alt: '', src: `api/models/${encodeURIComponent(name)}/preview?v=${model.saved_at_s}` })
      : h('span', { class: 'pixels blank' });
    return h('div', { class: `panel model${current ? ' current' : ''}`, role: 'listitem' },
      h('div', { class: 'facts-row' }, preview,
        h('div', { class: 'grow' }, h('h3', {}, name, ...(current ? [' ', h('span', { class: 'tag' }, t('home.current'))] : [])),
          h('small', {}, describe(model))),
        h('button', { type: 'button', class: 'quiet', 'aria-expanded': String(isOpen), 'aria-label': t('home.more', { name }), onclick: () => this.toggle(name) }, icon('more'))),
      isOpen ? this.tools(model) : null);
  }

  /** @param {Model} model */
  tools({ name, current, place, readable }) {
    const path = `api/models/${encodeURIComponent(name)}`;
    const nameField = h('input', { value: name, maxlength: 60, 'aria-label': t('home.name') });
    const placeField = h('input', { value: place, maxlength: 60, 'aria-label': t('home.place'), placeholder: t('home.place') });
    const button = (/** @type {string} */ key, /** @type {() => Promise<unknown>} */ act) =>
      h('button', { type: 'button', onclick: act }, t(key));
    const save = (/** @type {Event} */ event) => {
      event.preventDefault();
      this.act(async () => {
        this.open = (await ask('PATCH', path, { name: nameField.value.trim() || name, place: placeField.value })).name;
      });
    };
    return h('div', { class: 'stack' },
      h('form', { class: 'row', onsubmit: save }, nameField, placeField, h('button', {}, t('home.keep'))),
      h('div', { class: 'row' },
        !current && readable ? button('home.load', () => this.act(() => ask('POST', `${path}/load`))) : null,
        button('home.copy', () => this.act(() => ask('POST', `${path}/copy`, {}))),
        h('a', { class: 'button', href: `${path}/file`, download: '' }, t('download')),
        button('delete', () => this.discard(name))));
  }

  /** @param {string} name */
  toggle(name) {
    this.open = this.open === name ? null : name;
    this.draw();
  }

  /**
   * Change the models, then show the new list. The message comes after the new list, because a person who
   * has read the message may touch the list immediately. @param {() => Promise<any>} act
   */
  async act(act) {
    const answer = await this.attempt(act);
    await this.refresh();
    return answer;
  }

  /** @returns {string[]} the names of the last models with whose weights a new model can begin */
  earlier() {
    const current = this.known?.find((model) => model.current);
    const isAlike = (/** @type {Model} */ model) => model.readable && model.lessons >= ENOUGH &&
      model.learner === current?.learner && model.moves.join() === current?.moves.join();
    return (this.known ?? []).filter(isAlike).slice(0, MOST).map((model) => model.name);
  }

  async begin() {
    const like = this.alike?.checked ? this.earlier() : [];
    const begun = await this.act(() => ask('POST', 'api/models', { like }));
    if (!begun) return;
    const { name } = begun;
    this.page?.toast(like.length ? t('home.begun_like', { name, names: like.join(', ') }) : t('home.begun', { name }));
  }

  /** @param {string} name */
  async discard(name) {
    const deleted = await this.act(() => ask('DELETE', `api/models/${encodeURIComponent(name)}`));
    if (!deleted) return;
    this.page?.toast(t('home.deleted', { name }), {
      label: t('undo'), act: () => this.act(() => ask('POST', 'api/models/restore', { undo: deleted.undo })),
    });
  }

  /** @param {File} file */
  async upload(file) {
    const name = file.name.replace(/\.npz$/i, '');
    const kept = await this.act(async () => ask('PUT', `api/models/${encodeURIComponent(name)}/file`, new Blob([await contentOf(file)])));
    if (kept) this.page?.toast(t('home.uploaded', { name: kept.name }));
  }
}

/** @param {Model} model */
function describe(model) {
  if (!model.readable) return t('home.damaged');
  const when = model.saved_at_s === null ? '' :
    new Date(model.saved_at_s * 1000).toLocaleString(language, { dateStyle: 'medium', timeStyle: 'short' });
  return [t('images', { n: model.nodes }), t('home.lessons', { n: count(model.lessons) }), model.place, when]
    .filter(Boolean).join(' · ');
}

customElements.define('home-screen', HomeScreen);
