// The choice of the place to which a simulated robot is carried, with a map of each place.

import { ask } from '../api.js';
import { bounds, room } from '../components/from-above.js';
import { group } from '../components/screen.js';
import { h, svg } from '../dom.js';
import { fetchWords, has, t } from '../i18n.js';

/** @typedef {{world: import('../components/from-above.js').World & {name: string} | null, worlds: string[]}} Places */

/** @param {import('../components/settings-screen.js').SettingsScreen} screen @returns {Promise<HTMLElement | null>} null for a robot that is not simulated */
export async function showPlaces(screen) {
  await fetchWords((code) => import(`./places/messages/${code}.js`));
  const { world, worlds } = /** @type {Places} */ (await ask('GET', 'api/world').catch(() => ({ world: null, worlds: [] })));
  if (!world || worlds.length < 2) return null;
  const name = (/** @type {string} */ place) => (has(`world.${place}`) ? t(`world.${place}`) : place);
  const choice = h('select', { 'aria-label': t('settings.world'), onchange: () => screen.put('api/world', { name: choice.value }).then(() => screen.refresh()) },
    ...worlds.map((place) => h('option', { value: place, selected: place === world.name }, name(place))));
  const [left, bottom, right, top] = bounds([], world);
  const map = svg('svg', { viewBox: `${left} ${-top} ${right - left} ${top - bottom}`, class: 'above', 'aria-hidden': 'true' }, svg('g', { transform: 'scale(1 -1)' }, ...room(world)));
  return group(t('settings.world'), t('settings.world_hint'), choice, /** @type {any} */ (map));
}
