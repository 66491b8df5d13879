// What all screens besides the drive screen share.

import { h } from '../dom.js';
import { t } from '../i18n.js';

export class Screen extends HTMLElement {
  /** @param {import('../page.js').Page} page */
  start(page) {
    this.page = page;
    /** @type {(() => void)[]} */
    this.endings = [];
    this.build();
  }

  /** Subclasses fill the screen here. */
  build() {}

  disconnectedCallback() {
    for (const end of this.endings ?? []) end();
  }

  /** Do something now and then while the screen is open. @param {() => void} act @param {number} ms */
  every(ms, act) {
    act();
    const timer = setInterval(act, ms);
    this.endings?.push(() => clearInterval(timer));
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
