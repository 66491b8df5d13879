// <challenge-screen>: the rules of the challenge, the tries, the best try, and a button to start one.

import { ask } from '../api.js';
import { Screen } from '../components/screen.js';
import { append, fill, h, say } from '../dom.js';
import { t } from '../i18n.js';
import { metresOf, tellTry } from './results.js';

const LOOK_MS = 2000;

export class ChallengeScreen extends Screen {
  build() {
    this.best = h('p', { class: 'lead', role: 'status' });
    this.tries = h('ol', { class: 'panel stack' });
    this.start_button = h('button', { type: 'button', class: 'primary wide', onclick: () => this.begin() }, t('challenge.start'));
    this.shown = h('input', { type: 'checkbox', onchange: () => this.showOnBoard() });
    const choice = h('label', { class: 'choice' }, this.shown, h('span', {}, t('challenge.shown')));
    append(this, [h('p', { class: 'lead' }, t('challenge.lead')), this.best, this.tries, this.start_button, choice, h('p', { class: 'hint' }, t('challenge.rules'))]);
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
    const over = now.tries.length >= now.tries_of ? ` ${t('challenge.over')}` : '';
    const best = now.best_m === null ? t('challenge.none') : t('challenge.best', { metres: metresOf(now.best_m) });
    say(/** @type {Node} */ (this.best), !now.can_measure ? t('challenge.no_way') : now.is_on ? t('challenge.on', { metres: metresOf(now.metres) }) : best + over);
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
    await this.attempt(async () => {
      await ask('POST', 'api/challenge/try');
      this.page?.toast(t('challenge.armed'));
      location.hash = 'drive';
    });
  }
}

customElements.define('challenge-screen', ChallengeScreen);
