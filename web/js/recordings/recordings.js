// The recordings on the home screen, and training again from them.

import { h } from '../dom.js';
import { t } from '../i18n.js';
import { listEpisodes } from './episode-list.js';
import { showTeaching } from './teach-again.js';

/** @typedef {import('../components/screen.js').Screen & {act: (act: () => Promise<any>) => Promise<any>}} Home */

export class Recordings {
  again = h('div', { class: 'stack' });
  episodes = h('div', { class: 'stack' });
  finder = h('input', { type: 'search', 'aria-label': t('episodes.find'), placeholder: t('episodes.find') });
  chosen = h('div', { class: 'row' });
  offer = h('div', { class: 'stack' }, this.finder, this.chosen);
  /** @type {{episode: any, card: HTMLElement, isOn: boolean}[]} the recordings with their cards; `isOn` is true for the recording in progress */
  shelf = [];
  /** Number of requests for the list. If two requests are under way, only the answer to the newer one is shown. */
  listing = 0;
  /** @type {Set<string>} selected recordings, to download, to delete or to teach again from */
  ticked = new Set();
  /** @type {string | null} the recording whose card is open */
  openEpisode = null;

  /** @param {Home} home */
  constructor(home) {
    this.home = home;
  }

  get page() {
    return this.home.page;
  }

  get isConnected() {
    return this.home.isConnected;
  }

  /** Run an action, and show its error if it is refused. @param {() => Promise<any>} act */
  attempt(act) {
    return this.home.attempt(act);
  }
}

/** @param {Home} home */
export async function showRecordings(home) {
  const recordings = new Recordings(home);
  await Promise.all([listEpisodes(recordings), showTeaching(recordings)]);
  return h('div', { class: 'stack' }, recordings.again, recordings.episodes);
}
