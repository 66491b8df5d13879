// <challenge-screen>: the rules of the challenge, the tries, the best try, and a button to start a try.

import { ask } from '../api.js';
import { Screen } from '../components/screen.js';
import { append, fill, h, say } from '../dom.js';
import { t } from '../i18n.js';
import { armTry, metresOf, tellTry } from './results.js';

const LOOK_MS = 2000;

/** The text below the best try. @param {import('./results.js').Challenge} now */
function tellState({ can_measure: canMeasure, is_on: isOn, metres, best_m: bestM, tries, tries_of: of }) {
  if (!canMeasure) return t('challenge.no_way');
  if (isOn) return t('challenge.on', { metres: metresOf(metres) });
  if (bestM === null) return t('challenge.none');
  return tries.length >= of ? t('challenge.over') : '';
}

export class ChallengeScreen extends Screen {
  build() {
    this.best = h('strong', { class: 'score' });
    this.now = h('span');
    this.tries = h('ol', { class: 'panel stack' });
    this.start_button = h('button', { type: 'button', class: 'primary wide', onclick: () => this.begin() }, t('challenge.start'));
    this.shown = h('input', { type: 'checkbox', onchange: () => this.showOnBoard() });
    const choice = h('label', { class: 'choice' }, this.shown, h('span', {}, t('challenge.shown')));
    append(this, [h('p', { class: 'lead' }, t('challenge.lead')), h('p', { class: 'lead', role: 'status' }, this.best, this.now), this.tries, this.start_button, choice, h('p', { class: 'hint' }, t('challenge.rules'))]);
    return this.every(LOOK_MS, () => this.refresh());
  }

  async refresh() {
    const now = /** @type {import('./results.js').Challenge | undefined} */ (await this.inOrder(this.attempt(() => ask('GET', 'api/challenge'))));
    if (!now) return;
    const button = /** @type {HTMLButtonElement} */ (this.start_button);
    button.disabled = !now.can_measure || now.is_on;
    const shown = /** @type {HTMLInputElement} */ (this.shown);
    shown.disabled = !now.can_measure;
    shown.checked = now.is_shown;
    say(/** @type {Node} */ (this.best), now.best_m === null ? '' : t('challenge.best', { metres: metresOf(now.best_m) }));
    say(/** @type {Node} */ (this.now), tellState(now));
    const tries = /** @type {HTMLElement} */ (this.tries);
    tries.hidden = !now.tries.length;
    if (tries.childElementCount !== now.tries.length) fill(tries, ...now.tries.map((one, i) => h('li', {}, tellTry(one, i + 1, now.tries_of))));
  }

  async showOnBoard() {
    const { checked } = /** @type {HTMLInputElement} */ (this.shown);
    await this.attempt(() => ask('PUT', 'api/challenge', { is_shown: checked }));
    await this.refresh();
  }

  async begin() {
    const page = /** @type {import('../page.js').Page} */ (this.page);
    await this.attempt(() => armTry(page)); // the drive screen, which opens then, says what to do
  }
}

customElements.define('challenge-screen', ChallengeScreen);
