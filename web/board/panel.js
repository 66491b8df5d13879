// The panel in which the teacher changes one robot's name, colour, locks and model, or the locks of all robots.

import { ask } from '../js/api.js';
import { fill, h } from '../js/dom.js';
import { LANGUAGES, chooseLanguage, language, t } from '../js/i18n.js';
import { codeOf } from './card.js';
import { tellOutcome } from './outcome.js';

/** @typedef {import('./class-link.js').Robot} Robot */
/** @typedef {import('./outcome.js').Outcome} Outcome */

const COLOURS = ['grey', 'green', 'purple', 'pink', 'brown', 'teal'];
const ORDERS = ['keep', 'reset', 'hand_over'];
const LOCKS = ['settings', 'models', 'gallery', 'recordings'];

export class Panel {
  /** @param {HTMLElement} element @param {() => Robot[]} robots  returns the current robots */
  constructor(element, robots) {
    this.element = element;
    this.robots = robots;
    /** @type {number | 'all' | null} */
    this.subject = null;
    /** @type {Element | null} */
    this.opener = null;
    /** Function that shows in the open panel what was changed elsewhere. */
    this.follow = () => {};
    this.said = h('p', { class: 'said', role: 'status' });
    element.addEventListener('keydown', (event) => event.key === 'Escape' && (event.preventDefault(), this.close()));
  }

  close() {
    if (this.element.hidden) return;
    this.element.hidden = true;
    this.subject = null;
    /** @type {HTMLElement | null} */ (this.opener)?.focus();
  }

  /** @param {number | 'all'} subject */
  open(subject) {
    this.opener = document.activeElement;
    this.subject = subject;
    this.said.textContent = '';
    this.build();
    this.element.hidden = false;
    /** @type {HTMLElement | null} */ (this.element.querySelector('button'))?.focus();
  }

  /** Draw a robot's changes in the panel, but not while somebody is using it. @param {Robot} robot */
  note(robot) {
    if (!this.element.hidden) this.follow();
    const code = /** @type {HTMLImageElement | null} */ (this.element.querySelector('.code'));
    if (robot.number !== this.subject || !code || robot.status !== 'there') return;
    if (code.getAttribute('src') !== codeOf(robot)) code.src = codeOf(robot);
  }

  build() {
    const robot = this.robots().find(({ number }) => number === this.subject);
    const title = h('h2', { id: 'panel-title' }, robot ? robot.name : t('board.class_settings'));
    const close = h('button', { type: 'button', onclick: () => this.close() }, t('board.close'));
    this.element.setAttribute('aria-labelledby', 'panel-title');
    fill(this.element, h('div', { class: 'title' }, title, close), ...(robot ? this.one(robot) : this.all()), this.said);
  }

  /** @param {Robot} robot */
  one(robot) {
    const change = (/** @type {object} */ words) => this.attempt(() => ask('PUT', `api/robots/${robot.number}`, words));
    const name = h('input', { value: robot.name, maxlength: 24, 'aria-label': t('board.name'), onchange: () => change({ name: name.value.trim() }) });
    const colour = h('select', { 'aria-label': t('board.colour'), onchange: () => change({ colour: colour.value }) },
      ...COLOURS.map((one) => h('option', { value: one, selected: one === robot.colour }, t(`board.colour.${one}`))));
    const code = robot.status === 'there'
      ? h('figure', {}, h('img', { class: 'code', alt: t('board.code_of', { name: robot.name }), src: codeOf(robot) }), h('figcaption', {}, t('board.scan')))
      : null;
    return [
      code,
      h('div', { class: 'row' }, name, colour),
      this.locks(() => this.robots().filter(({ number }) => number === this.subject)),
      this.models(robot),
    ];
  }

  all() {
    const choice = h('select', { 'aria-label': t('board.language'), onchange: () => chooseLanguage(choice.value) },
      ...Object.entries(LANGUAGES).map(([code, own]) => h('option', { value: code, selected: code === language, lang: code }, own)));
    return [
      h('p', {}, t('board.all_hint')),
      this.locks(this.robots),
      this.lessonEnd(),
      h('div', { class: 'row' }, ...['codes', 'lesson'].map((href) => h('a', { class: 'button', href, target: '_blank' }, t(href === 'codes' ? 'board.codes' : 'board.lessons')))),
      h('div', { class: 'row' }, choice),
    ];
  }

  /** Buttons that keep, reset or hand over all robots; each robot's result is listed, and the order can be undone. */
  lessonEnd() {
    const list = h('ul', { class: 'outcomes' });
    const undo = h('button', { type: 'button', disabled: true, onclick: () => give('api/models/undo') }, t('board.end.undo'));
    /** @param {{order: string | null, robots: Outcome[]}} told */
    const show = ({ order, robots }) => {
      undo.disabled = order === null || order === 'undo';
      const bad = robots.filter(({ did }) => did === 'away' || did === 'failed');
      const good = robots.filter((one) => !bad.includes(one));
      fill(list, ...[...bad, ...good].map((one) => h('li', { 'data-did': one.did }, tellOutcome(one), ...(one.detail ? [h('small', {}, ` ${one.detail}`)] : []))));
    };
    /** @param {string} path @param {object} [words] */
    const give = (path, words = {}) => this.attempt(async () => {
      const told = await ask('POST', path, words);
      show(told);
      undo.disabled = (await ask('GET', 'api/models')).order === null;
    });
    ask('GET', 'api/models').then(show, () => {});
    const rows = ORDERS.map((order) => h('div', { class: 'row order' },
      h('button', { type: 'button', 'data-order': order, onclick: () => give('api/models', { order }) }, t(`board.end.${order}`)),
      h('span', {}, t(`board.end.${order}_hint`))));
    return h('fieldset', {}, h('legend', {}, t('board.end')), ...rows, undo, h('div', { role: 'status' }, list));
  }

  /** Checkboxes for the locks of these robots. Changing one lock leaves the other locks of each robot unchanged. @param {() => Robot[]} those */
  locks(those) {
    /** @type {Map<string, boolean>} choices made here, until the robots report them */
    const chosen = new Map();
    const boxes = LOCKS.map((name) => h('input', { type: 'checkbox', value: name }));
    this.follow = () => {
      const there = those().filter(({ status }) => status === 'there');
      const robots = there.length ? there : those();
      for (const box of boxes) {
        const are = robots.map(({ locks }) => locks.includes(box.value));
        if (are.every((isLocked) => isLocked === chosen.get(box.value))) chosen.delete(box.value);
        box.checked = chosen.get(box.value) ?? (are.length > 0 && !are.includes(false));
      }
    };
    this.follow();
    const change = (/** @type {HTMLInputElement} */ { value, checked }) => this.attempt(async () => {
      chosen.set(value, checked);
      const told = those().map(async ({ number, locks }) => {
        const now = await ask('PUT', `api/robots/${number}`, { locks: LOCKS.filter((name) => chosen.get(name) ?? locks.includes(name)) });
        for (const robot of those()) if (robot.number === number) robot.locks = now.locks; // update the panel now, because the news of the new locks may arrive later
      });
      const faults = (await Promise.allSettled(told)).flatMap((one) => (one.status === 'rejected' ? one.reason : []));
      if (!faults.length) return;
      chosen.delete(value); // so that the next checkbox does not send this choice again
      this.follow();
      throw faults.find((fault) => fault instanceof TypeError) ?? new Error(faults.map(({ message }) => message).join('\n'));
    });
    for (const box of boxes) box.addEventListener('change', () => change(box));
    const rows = boxes.map((box) => h('label', { class: 'choice' }, box, h('span', {}, t(`board.lock.${box.value}`))));
    return h('fieldset', {}, h('legend', {}, t('board.locked')), ...rows);
  }

  /** @param {Robot} robot */
  models(robot) {
    const others = this.robots().filter(({ number, status }) => number !== robot.number && status === 'there');
    const boxes = others.map((other) => h('input', { type: 'checkbox', value: other.number }));
    const rows = others.map((other, i) => h('label', { class: 'choice' }, boxes[i], h('span', {}, other.name)));
    const copy = async () => {
      const to = boxes.filter((box) => box.checked).map((box) => Number(box.value));
      const { faults } = await ask('POST', `api/robots/${robot.number}/copy-model`, { to });
      if (faults.length) throw new Error(faults.join('\n'));
    };
    const give = h('button', { type: 'button', onclick: () => boxes.some((box) => box.checked) && this.attempt(copy) }, t('board.give'));
    return h('fieldset', {}, h('legend', {}, t('board.give_to')), ...(rows.length ? [...rows, give] : [h('p', {}, t('board.no_others'))]));
  }

  /** @param {() => Promise<any>} act */
  async attempt(act) {
    this.said.textContent = t('board.wait');
    try {
      await act();
      this.said.textContent = t('board.done');
    } catch (error) {
      this.said.textContent = error instanceof TypeError ? t('board.board_away') : /** @type {Error} */ (error).message;
    }
  }
}
