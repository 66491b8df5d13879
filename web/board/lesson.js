// Shows a lesson of docs/lessons, for a projector. The part for the teacher (text, answers, button) is collapsed.

import { ask } from '../js/api.js';
import { fill, h } from '../js/dom.js';
import { language, loadLanguage, t } from '../js/i18n.js';
import { piecesIn } from './markdown.js';
import { tellOutcome } from './outcome.js';

/** @typedef {import('./markdown.js').Piece} Piece */
/** @typedef {import('./markdown.js').Word} Word */

/** The names of the lessons, in the order of the pages in docs/lessons. The answer sheet follows the last lesson. */
const LESSONS = ['teach-it', 'fool-it', 'fair-data'];
const READY = 'fair-data';

/** @param {string} id */
const find = (id) => /** @type {HTMLElement} */ (document.getElementById(id));

await loadLanguage([(code) => import(`./messages/${code}.js`)]);
const own = await fetch(`lesson/${language}`);
const { lesson: running } = await ask('GET', 'api/lesson');
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
  /** Empty cells at the end of a row are left out, and the last non-empty cell spans their columns. @param {Word[][]} cells */
  const row = (cells) => {
    const said = cells.filter((cell, i) => i === 0 || cell.length);
    return h('tr', {}, ...said.map((cell, i) => h('td', { colspan: i === said.length - 1 ? cells.length - i : 1 }, ...spoken(cell))));
  };
  return h('table', {},
    h('thead', {}, h('tr', {}, ...piece.head.map((cell) => h('th', { scope: 'col' }, ...spoken(cell))))),
    h('tbody', {}, ...piece.rows.map(row)));
}

/** @param {Piece[]} part */
const titleOf = ([first]) => (first?.kind === 'h2' ? first.words.map(({ text: said }) => said).join('') : '');

const sheet = parts[LESSONS.length] ?? [];
const answers = sheet.flatMap((piece) => (piece.kind === 'ul' ? piece.items : []));
const links = LESSONS.map((name, i) => h('a', { href: `lesson#${name}` }, titleOf(parts[i] ?? [])));
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
    fill(said, ...robots.map((/** @type {import('./outcome.js').Outcome} */ one) => h('li', {}, `${tellOutcome(one)} ${one.detail}`)));
  } catch (error) {
    fill(said, h('li', {}, error instanceof TypeError ? t('board.board_away') : /** @type {Error} */ (error).message));
  }
  give.disabled = false;
}

/** The teacher's part is closed until the teacher opens it, because pupils see the page too. @param {Piece | undefined} piece @param {Word[]} answer */
function drawForTeacher(piece, [, ...answer]) {
  const [title, ...words] = piece?.kind === 'quote' ? piece.words : [];
  find('teacher').hidden = !title;
  /** @type {HTMLDetailsElement} */ (find('teacher')).open = false;
  fill(find('title'), title?.text.replace(/[.。]$/, '') ?? '');
  fill(find('told'), h('p', {}, ...spoken(words)), h('p', {}, h('strong', {}, titleOf(sheet)), ...spoken(answer)));
}

function show() {
  const at = Math.max(0, LESSONS.indexOf(location.hash.slice(1) || running));
  const pieces = parts[at] ?? [];
  const isTold = (/** @type {Piece} */ { kind }) => kind === 'quote';
  links.forEach((link, i) => (i === at ? link.setAttribute('aria-current', 'page') : link.removeAttribute('aria-current')));
  fill(find('lesson'), ...pieces.filter((piece) => !isTold(piece)).map(draw));
  drawForTeacher(pieces.find(isTold), answers[at] ?? []);
  find('acts').hidden = LESSONS[at] !== READY;
  document.title = `${titleOf(pieces)} · Drivelesson`;
  scrollTo(0, 0);
}

addEventListener('hashchange', show);
show();
