// Shows the screen named after # in the address. Screens are loaded when first opened.

import { ask } from './api.js';
import { h } from './dom.js';
import { fetchWords, t } from './i18n.js';
import { loadSections, partScreens } from './parts.js';

/** The screens of the core, besides the drive screen; extensions register theirs. */
const SCREENS = ['settings'];

const AGAIN_MS = 3000;

/** Fetch the sentences of the core's other screens. */
export const fetchScreenWords = () => fetchWords((code) => import(`./components/screens/messages/${code}.js`));

export class Router {
  /** @param {import('./page.js').Page} page */
  constructor(page) {
    this.page = page;
    this.drive = /** @type {HTMLElement} */ (document.querySelector('main#drive'));
    this.other = /** @type {HTMLElement} */ (document.querySelector('main#other'));
    this.turn = 0;
  }

  start() {
    addEventListener('hashchange', () => this.show());
    this.show();
  }

  /** @param {number} [failures]  how often the screen could not be loaded */
  async show(failures = 0) {
    const wanted = location.hash.slice(1);
    const added = partScreens()[wanted];
    const screen = added || SCREENS.includes(wanted) ? wanted : 'drive';
    const { page, drive, other } = this;
    const turn = (this.turn += 1); // show only the screen that was opened last
    page.helm.releaseAll();
    page.store.set({ screen, notice: null });
    document.body.dataset.screen = screen;
    document.title = screen === 'drive' ? t('app') : `${t(`screen.${screen}`)} · ${t('app')}`;
    drive.hidden = screen !== 'drive';
    other.hidden = screen === 'drive';
    other.replaceChildren();
    if (screen === 'drive') return;
    const alert = h('p', { class: 'panel', role: 'alert' }, t('unreachable'));
    const late = setTimeout(() => turn === this.turn && other.append(alert), AGAIN_MS);
    const load = added?.load ?? (() => import(`./components/${screen}-screen.js`));
    const isThere = await Promise.all([load(), fetchScreenWords(), loadSections(screen)]).then(() => true, () => false);
    clearTimeout(late);
    if (turn !== this.turn) return;
    if (!isThere) {
      other.append(alert);
      // Load the whole page again if the robot answers but lacks a file, because it was updated and has a newer page.
      const renew = () => alert.isConnected && page.store.state.robot?.mode === 'stopped' && location.reload();
      if (failures) ask('GET', 'healthz').then(renew, () => {});
      setTimeout(() => turn === this.turn && this.show(failures + 1), AGAIN_MS);
      return;
    }
    const element = /** @type {any} */ (document.createElement(`${screen}-screen`));
    other.replaceChildren(element);
    element.start(page);
    scrollTo(0, 0);
  }
}
