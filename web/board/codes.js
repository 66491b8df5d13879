// A card for each robot to print, four on a sheet. The codes stay valid until the class key changes.

import { ask } from '../js/api.js';
import { fill, h, say } from '../js/dom.js';
import { loadLanguage, t } from '../js/i18n.js';

/** @typedef {import('./class-link.js').Robot} Robot */

const AGAIN_MS = 1000;
const WIFI = 'drivelesson.wifi';

/** @param {string} id */
const find = (id) => /** @type {HTMLElement} */ (document.getElementById(id));

await loadLanguage([(code) => import(`./messages/${code}.js`)]);
document.title = `${t('board.codes')} · Drivelesson`;
say(find('title'), t('board.codes'));
say(find('how'), t('board.codes_how'));
say(find('wifi-name'), t('board.wifi'));
const wifi = /** @type {HTMLInputElement} */ (find('wifi'));
try { wifi.value ||= localStorage.getItem(WIFI) ?? ''; } catch { /* without storage, the teacher must type the name again next time */ }
say(find('print'), t('board.print'));
wifi.addEventListener('change', () => {
  try { localStorage.setItem(WIFI, wifi.value); } catch { /* the cards show the name even if it cannot be stored */ }
});
find('print').addEventListener('click', () => window.print());

/** @param {Robot} robot @param {string} token  for a phone that cannot scan */
function draw({ number, name, page, status, detail, colour }, token) {
  const code = status === 'there'
    ? h('img', { class: 'code', alt: t('board.code_of', { name }), src: `api/robots/${number}/qr.svg?printed=true&at=${encodeURIComponent(page)}` })
    : h('p', { class: 'code' }, `${t(`board.status.${status}`)} ${detail}`);
  const network = wifi.value.trim();
  const steps = [network ? t('board.card_wifi', { name: network }) : t('board.card_wifi_any'), t('board.card_scan'), t('board.card_teach')];
  return h('article', { 'data-colour': colour ?? 'grey' },
    h('h2', {}, h('img', { alt: '', src: 'icons/face.svg' }), name, h('small', {}, t(`board.colour.${colour ?? 'grey'}`))),
    code, h('ol', {}, ...steps.map((step) => h('li', {}, step))),
    h('p', {}, t('board.card_nothing')), h('p', {}, page), h('p', {}, t('board.card_token', { token: token.match(/.{1,4}/g)?.join('-') ?? '' })));
}

/** Robots start one after the other, so the page draws new cards as long as it is open. */
let shown = '';
for (;;) {
  /** @type {{robots: Robot[], code: string}} */
  const { robots, code } = await ask('GET', 'api/robots').catch(() => ({ robots: [], code: '' }));
  const now = JSON.stringify([wifi.value, ...robots.map(({ number, name, page, status, colour }) => [number, name, page, status, colour])]);
  if (robots.length && now !== shown) fill(find('codes'), ...robots.map((robot) => draw(robot, code)));
  if (robots.length) shown = now;
  await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
}
