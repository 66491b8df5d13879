// <toast-bar>: a sentence that goes away by itself, with one step to take, such as Undo.

import { fill, h } from '../dom.js';

const SHOWN_MS = 8000;

export class ToastBar extends HTMLElement {
  connectedCallback() {
    this.setAttribute('role', 'status');
    this.hidden = true;
  }

  /** @param {string} text @param {{label: string, act: () => void} | null} [step] */
  show(text, step = null) {
    clearTimeout(this.timer);
    const take = () => {
      this.hidden = true;
      step?.act();
    };
    fill(this, h('p', {}, text), step && h('button', { type: 'button', onclick: take }, step.label));
    this.hidden = false;
    this.timer = setTimeout(() => (this.hidden = true), SHOWN_MS);
  }
}

customElements.define('toast-bar', ToastBar);
