// The codes of all robots on one sheet, to print: they stay good as long as the class has its key.

import { ask } from '../js/api.js';
import { fill, h, say } from '../js/dom.js';
import { loadLanguage, t } from '../js/i18n.js';

/** @typedef {import('./class-link.js').Robot} Robot */

const AGAIN_MS = 1000;

/** @param {string} id */
const find = (id) => /** @type {HTMLElement} */ (document.getElementById(id));

await loadLanguage();
document.title = `${t('board.codes')} · Drivelesson`;
say(find('how'), t('board.codes_how'));
say(find('print'), t('board.print'));
find('print').addEventListener('click', () => window.print());

/** @param {Robot} robot */
function draw({ number, name, address, status, detail }) {
  const code = status === 'there'
    ? h('img', { alt: t('board.code_of', { name }), src: `api/robots/${number}/qr.svg?printed=true` })
    : h('p', {}, `${t(`board.status.${status}`)} ${detail}`);
  return h('figure', {}, code, h('figcaption', {}, h('b', {}, name), h('small', {}, address)));
}

/** Robots start one after the other: what has changed is drawn, until the page is closed. */
let shown = '';
for (;;) {
  /** @type {{robots: Robot[]}} */
  const { robots } = await ask('GET', 'api/robots').catch(() => ({ robots: [] }));
  const now = JSON.stringify(robots.map(({ number, name, address, status }) => [number, name, address, status]));
  if (robots.length && now !== shown) fill(find('codes'), ...robots.map(draw));
  if (robots.length) shown = now;
  await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
}
