// <undo-screen>: undoes the last seconds of teaching; first, it shows the frames that would be removed.

import { ask } from '../api.js';
import { append, fill, h, icon, say } from '../dom.js';
import { count, t } from '../i18n.js';
import { Screen, segments } from '../components/screen.js';

const CHOICES = ['5', '10', '30'];

export class UndoScreen extends Screen {
  build() {
    this.seconds = CHOICES[0];
    /** The number of seconds whose frames are shown and can be undone; the answer to a newer choice may still be under way. */
    this.shown = this.seconds;
    this.summary = h('p', { role: 'status' });
    this.strip = h('div', { class: 'strip', role: 'list' });
    this.button = h('button', { type: 'button', class: 'primary wide', disabled: true, onclick: () => this.undo() });
    append(this, [
      h('p', { class: 'lead' }, t('undo.lead')),
      segments(t('undo.how_much'), CHOICES.map((s) => [s, t('undo.seconds', { s })]), this.seconds, (/** @type {string} */ seconds) => {
        this.seconds = seconds;
        this.refresh();
      }),
      this.summary, this.strip, this.button,
    ]);
    return this.refresh();
  }

  async refresh() {
    const seconds = this.seconds;
    const last = await this.inOrder(this.attempt(() => ask('GET', `api/teaching/last?seconds=${seconds}`)));
    if (!last) return;
    this.shown = seconds;
    const { lessons, taught, strip } = /** @type {any} */ (last);
    const parts = Object.entries(taught).filter(([, n]) => n).map(([move, n]) => `${t(`move.${move}`)} ${count(n)}`);
    say(/** @type {Node} */ (this.summary), lessons ? t('undo.summary', { n: count(lessons), parts: parts.join(', ') }) : t('undo.nothing'));
    fill(/** @type {Element} */ (this.strip), ...strip.map(frame));
    const button = /** @type {HTMLButtonElement} */ (this.button);
    button.disabled = lessons === 0;
    fill(button, icon('undo'), t('undo.forget', { n: count(lessons) }));
  }

  async undo() {
    await this.attempt(async () => {
      const { undone } = await ask('POST', 'api/teaching/undo', { seconds: Number(this.shown) });
      this.page?.toast(t('undo.done', { n: count(undone) }));
      await this.refresh();
    });
  }
}

/** @param {{png: string, label: string}} lesson */
function frame({ png, label }) {
  return h('div', { role: 'listitem' },
    h('img', { class: 'pixels', width: 40, height: 30, alt: '', src: `data:image/png;base64,${png}` }),
    h('span', { class: 'under' }, icon(label), t(`move.${label}`)));
}

customElements.define('undo-screen', UndoScreen);
