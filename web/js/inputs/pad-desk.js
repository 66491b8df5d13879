// Shows the page's texts about game pads, and stores the directions of pads whose layout the browser does not know.

import { t } from '../i18n.js';

/** @param {import('../page.js').Page} page @returns {import('./gamepad.js').PadDesk} */
export function padDesk(page) {
  const { preferences, store } = page;
  return {
    choiceOf: (id) => preferences.padOf(id),
    keep: (id, choice) => preferences.choosePad(id, choice),
    offer: (name, begin) => {
      if (!store.state.toast) page.toast(t('pad.unknown', { name }), { label: t('pad.choose'), act: begin });
    },
    ask: (name, direction, skip) => {
      if (direction === 'rest') page.toast(t('pad.rest', { name }), null, Infinity);
      else if (direction) page.toast(t('pad.push', { name, direction: t(`move.${direction}`) }), { label: t('pad.skip'), act: skip }, Infinity);
      else page.toast(t('pad.chosen', { name }));
    },
    tell: (key, name) => page.toast(t(key, { name })),
  };
}
