// <toast-bar>: a sentence that disappears by itself, with one button, for example "Undo".

import { fill, h } from '../dom.js';

export class ToastBar extends HTMLElement {
  /** @param {import('../page.js').Page} page */
  start(page) {
    this.page = page;
    this.setAttribute('role', 'status');
    page.store.watch(['toast'], ({ toast }) => {
      this.hidden = !toast;
      if (toast) fill(this, h('p', {}, toast.text), ...stepButton(page, toast));
    });
  }
}

/**
 * The button for a toast's action, if the toast has one.
 * @param {import('../page.js').Page} page
 * @param {import('../store.js').Toast} toast
 */
export function stepButton(page, { step }) {
  const take = () => {
    page.store.set({ toast: null });
    step?.act();
  };
  return step ? [h('button', { type: 'button', onclick: take }, step.label)] : [];
}

customElements.define('toast-bar', ToastBar);
