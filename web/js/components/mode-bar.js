// <mode-bar>: Stop, Teach, Drive itself.

import { append, h } from '../dom.js';
import { t } from '../i18n.js';

/** @type {readonly import('../protocol.js').Mode[]} */
const MODES = ['stopped', 'train', 'autonomous'];

export class ModeBar extends HTMLElement {
  /** @param {import('../page.js').Page} page */
  start(page) {
    this.setAttribute('role', 'radiogroup');
    this.setAttribute('aria-label', t('mode'));
    this.buttons = MODES.map((mode) => h('button', {
      type: 'button', role: 'radio', 'aria-checked': 'false', 'data-mode': mode, onclick: () => page.choose(mode),
    }, t(`mode.${mode}`)));
    append(this, this.buttons);
    page.store.watch(['robot', 'link'], ({ robot, link }) => {
      for (const button of this.buttons ?? []) {
        const isOn = link === 'open' && robot?.mode === button.dataset.mode;
        button.setAttribute('aria-checked', String(isOn));
        button.disabled = link !== 'open' || !robot?.you_are_pilot || robot.emergency;
      }
    });
  }
}

customElements.define('mode-bar', ModeBar);
