// A lesson of docs/lessons to project, and the answer sheet separately.

import { ask } from '../js/api.js';
import { fill, h } from '../js/dom.js';
import { language, loadLanguage, t } from '../js/i18n.js';
import { piecesIn } from './markdown.js';

/** @typedef {import('./markdown.js').Piece} Piece */
/** @typedef {import('./markdown.js').Word} Word */

/** The parts of a page of docs/lessons, in their order; the last is the answer sheet. */
const PARTS = ['teach-it', 'fool-it', 'fair-data', 'answers'];
const READY = 'fair-data';

/** @param {string} id */
const find = (id) => /** @type {HTMLElement} */ (document.getElementById(id));

await loadLanguage([(code) => import(`./messages/${code}.js`)]);
const own = await fetch(`lesson/${language}`);
const text = await (own.ok ? own : await fetch('lesson/en')).text();
/** @type {Piece[][]} */
const parts = [];
for (const piece of piecesIn(text)) {
  if (piece.kind === 'h2') parts.push([]);
  parts[parts.length - 1]?.push(piece);
}

/** @param {Word[]} words */
const spoken = (words) => words.map(({ kind, text: said }) => (kind === 'text' ? said : h(kind, {}, said)));

/** @param {Piece} piece */
function draw(piece) {
  if (piece.kind === 'ul') return h('ul', {}, ...piece.items.map((item) => h('li', {}, ...spoken(item))));
  if (piece.kind !== 'table') return h(piece.kind === 'h2' ? 'h1' : 'p', {}, ...spoken(piece.words));
  /** A step with nothing to look for has the room of both. @param {Word[][]} cells */
  const row = (cells) => {
    const said = cells.filter((cell, i) => i === 0 || cell.length);
    return h('tr', {}, ...said.map((cell, i) => h('td', { colspan: i === said.length - 1 ? cells.length - i : 1 }, ...spoken(cell))));
  };
  return h('table', {},
    h('thead', {}, h('tr', {}, ...piece.head.map((cell) => h('th', { scope: 'col' }, ...spoken(cell))))),
    h('tbody', {}, ...piece.rows.map(row)));
}

/** @param {Piece[]} part */
const titleOf = ([first]) => (first.kind === 'h2' ? first.words.map(({ text: said }) => said).join('') : '');

const links = parts.map((part, i) => h('a', { href: `lesson#${PARTS[i]}` }, titleOf(part)));
fill(find('lessons'), ...links);
find('lessons').setAttribute('aria-label', t('board.lessons'));

const said = h('ul');
const give = h('button', { type: 'button', onclick: giveAll }, t('board.lesson.give'));
fill(find('acts'), give, h('small', {}, t('board.lesson.give_hint')), h('div', { role: 'status' }, said));

async function giveAll() {
  give.disabled = true;
  fill(said, h('li', {}, t('board.wait')));
  try {
    const { robots } = await ask('POST', 'api/models/left-turns', { name: t('board.lesson.model') });
    fill(said, ...robots.map((/** @type {any} */ one) => h('li', {}, `${t(`board.end.did.${one.did}`, { ...one })} ${one.detail}`)));
  } catch (error) {
    fill(said, h('li', {}, error instanceof TypeError ? t('board.board_away') : /** @type {Error} */ (error).message));
  }
  give.disabled = false;
}

function show() {
  const at = Math.max(0, PARTS.indexOf(location.hash.slice(1)));
  links.forEach((link, i) => (i === at ? link.setAttribute('aria-current', 'page') : link.removeAttribute('aria-current')));
  fill(find('lesson'), ...(parts[at] ?? []).map(draw));
  find('acts').hidden = PARTS[at] !== READY;
  document.title = `${titleOf(parts[at] ?? [{ kind: 'p', words: [] }])} · Drivelesson`;
  scrollTo(0, 0);
}

addEventListener('hashchange', show);
show();
