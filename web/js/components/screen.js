// What all screens besides the drive screen share.

import { inOrder } from '../api.js';
import { h } from '../dom.js';
import { t } from '../i18n.js';

const PATIENCE_MS = 2000;

export class Screen extends HTMLElement {
  /** For what the screen shows: an action asks for it anew while an earlier answer is still under way. */
  inOrder = inOrder();

  /**
   * Show the screen once it has what it asks for: what comes later would move a button away while a
   * finger comes down on it. On a slow link it is shown as it is after a while.
   * @param {import('../page.js').Page} page
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

  /** Subclasses fill the screen here. @returns {unknown} a promise, if it asks the robot for something */
  build() {
    return undefined;
  }

  disconnectedCallback() {
    for (const end of this.endings ?? []) end();
  }

  /** Do something now and then while the screen is open; returns what it returned first. @param {() => unknown} act @param {number} ms */
  every(ms, act) {
    let isUnderWay = false;
    const next = async () => {
      if (isUnderWay) return; // on a slow link questions would pile up, and a STOP behind them
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

  /** Run an action that may be refused, and show the error. @param {() => Promise<any>} act */
  async attempt(act) {
    try {
      return await act();
    } catch (error) {
      this.page?.toast(error instanceof TypeError ? t('unreachable') : /** @type {Error} */ (error).message);
      return undefined;
    }
  }
}

/** What is in a chosen file; one that has changed since is not given out by the browser. @param {Blob} file */
export const contentOf = (file) => file.arrayBuffer().catch(() => Promise.reject(new Error(t('unreadable'))));

/**
 * A row of choices of which one is on.
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
