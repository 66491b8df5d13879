// Base of all screens except the drive screen.

import { inOrder } from '../api.js';
import { h, svg } from '../dom.js';
import { t } from '../i18n.js';

const PATIENCE_MS = 2000;

export class Screen extends HTMLElement {
  /** Drops answers that were overtaken: an action requests new data while the answer to an earlier request is under way. */
  inOrder = inOrder();

  /**
   * Show the screen once its data has loaded, because later data would move a button away from under a
   * finger. On a slow link, the screen is shown after a while although data is missing. @param {import('../page.js').Page}
   * page
   */
  async start(page) {
    this.page = page;
    /** @type {(() => void)[]} */
    this.endings = [];
    this.setAttribute('aria-busy', 'true');
    const late = new Promise((patience) => setTimeout(patience, PATIENCE_MS));
    try {
      await Promise.race([this.build(), late]);
    } finally {
      this.removeAttribute('aria-busy');
    }
  }

  /** Subclasses override this method to fill the screen. @returns {unknown} a promise, if it sends requests to the robot */
  build() {
    return undefined;
  }

  disconnectedCallback() {
    for (const end of this.endings ?? []) end();
  }

  /** Call `act` now, and again every `ms` while the screen is open; return the result of the first call. @param {() => unknown} act @param {number} ms */
  every(ms, act) {
    let isUnderWay = false;
    const next = async () => {
      if (isUnderWay) return; // otherwise requests would pile up on a slow link, and a STOP would wait behind them
      isUnderWay = true;
      try {
        await act();
      } finally {
        isUnderWay = false;
      }
    };
    const timer = setInterval(next, ms);
    this.endings?.push(() => clearInterval(timer));
    return next();
  }

  /**
   * @param {Parameters<import('../store.js').Store['watch']>[0]} keys
   * @param {Parameters<import('../store.js').Store['watch']>[1]} tell
   */
  watch(keys, tell) {
    const end = this.page?.store.watch(keys, tell);
    if (end) this.endings?.push(end);
  }

  /** Run an action, and show its error if it is refused. @param {() => Promise<any>} act */
  async attempt(act) {
    try {
      return await act();
    } catch (error) {
      this.page?.toast(error instanceof TypeError ? t('unreachable') : /** @type {Error} */ (error).message);
      return undefined;
    }
  }
}

/** Return the content of a chosen file; the browser refuses to read it if it has changed since it was chosen. @param {Blob} file */
export const contentOf = (file) => file.arrayBuffer().catch(() => Promise.reject(new Error(t('unreadable'))));

/**
 * A row of choices, one of which is selected.
 * @param {string} label
 * @param {[string, string][]} options  value and text
 * @param {string} value
 * @param {(value: string) => void} choose
 */
export function segments(label, options, value, choose) {
  const row = h('div', { class: 'segments', role: 'radiogroup', 'aria-label': label });
  const buttons = options.map(([option, text]) =>
    h('button', { type: 'button', role: 'radio', 'aria-checked': String(option === value), onclick: () => pick(option) }, text));
  const pick = (/** @type {string} */ picked) => {
    options.forEach(([option], i) => buttons[i].setAttribute('aria-checked', String(option === picked)));
    choose(picked);
  };
  row.append(...buttons);
  return row;
}

/** A group of settings. @param {string} title @param {string} hint @param {...(Node | null)} parts */
export function group(title, hint, ...parts) {
  return h('fieldset', { class: 'panel' }, h('legend', {}, title), hint ? h('p', { class: 'hint' }, hint) : null, ...parts);
}

/** Make a text for a drawing. @param {number} x @param {number} y @param {string} anchor @param {string} words */
export function text(x, y, anchor, words) {
  const element = svg('text', { x, y, 'text-anchor': anchor });
  element.textContent = words;
  return element;
}
