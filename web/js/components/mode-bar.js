// <mode-bar>: the buttons "Stop", "Teach" and "Drive itself"; the button to press now is highlighted.
//
// A button that becomes disabled keeps the focus.
// Arrow keys move the focus, as in any group of choices, but do not choose a mode, so that no robot starts by accident.
// After a tap, arrow keys drive.

import { modeToPress } from '../advice.js';
import { append, h } from '../dom.js';
import { t } from '../i18n.js';

/** @type {readonly import('../protocol.js').Mode[]} */
const MODES = ['stopped', 'train', 'autonomous'];
/** @type {Record<string, number>} */
const STEPS = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 };

export class ModeBar extends HTMLElement {
  /** @param {import('../page.js').Page} page */
  start(page) {
    this.setAttribute('role', 'radiogroup');
    this.setAttribute('aria-label', t('mode'));
    const tap = (/** @type {MouseEvent} */ event) => {
      const button = /** @type {HTMLElement} */ (event.currentTarget);
      if (event.detail) button.blur();
      if (button.getAttribute('aria-disabled') !== 'true') page.choose(/** @type {any} */ (button.dataset.mode));
    };
    const buttons = MODES.map((mode) => h('button', {
      type: 'button', role: 'radio', 'aria-checked': 'false', 'data-mode': mode, onclick: tap,
      // Handle taps here, because browsers send no click for a tap while another finger holds a direction.
      onpointerup: (/** @type {PointerEvent} */ event) => !event.isPrimary && isUnder(event) && tap(event),
    }, t(`mode.${mode}`)));
    append(this, buttons);
    this.addEventListener('keydown', (event) => {
      const at = buttons.indexOf(/** @type {any} */ (event.target));
      if (!(event.key in STEPS) || at < 0) return;
      event.preventDefault();
      event.stopPropagation();
      buttons[(at + STEPS[event.key] + MODES.length) % MODES.length].focus();
    });
    page.store.watch(['robot', 'link'], ({ robot, link }) => {
      const mode = (link === 'open' && robot?.mode) || null;
      const isBarred = link !== 'open' || !robot?.you_are_pilot || robot.emergency;
      for (const button of buttons) {
        const isOn = button.dataset.mode === mode;
        button.setAttribute('aria-checked', String(isOn));
        button.setAttribute('aria-disabled', String(isBarred));
        button.tabIndex = isOn || (!mode && button === buttons[0]) ? 0 : -1;
      }
    });
    page.store.watch(['robot', 'link', 'readiness', 'hint', 'notice', 'lead'], (state) => {
      const wanted = modeToPress(state);
      for (const button of buttons) button.classList.toggle('lit', button.dataset.mode === wanted);
    });
  }
}

/** True if a finger was lifted on the same button. @param {PointerEvent} event */
function isUnder({ clientX, clientY, currentTarget }) {
  return /** @type {Element} */ (currentTarget).contains(document.elementFromPoint(clientX, clientY));
}

customElements.define('mode-bar', ModeBar);
