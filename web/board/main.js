// The teacher's page: all robots of a class, and STOP for all robots above everything else.

import { socketBase } from '../js/api.js';
import { append, fill, h, say } from '../js/dom.js';
import { loadLanguage, t } from '../js/i18n.js';
import { listenForStop } from '../js/inputs/stop-keys.js';
import { layStops, makeStop } from '../js/stop.js';
import { Card } from './card.js';
import { ClassLink } from './class-link.js';
import { Panel } from './panel.js';

/** @typedef {import('./class-link.js').Robot} Robot */

/** @param {string} id */
const find = (id) => /** @type {HTMLElement} */ (document.getElementById(id));

await loadLanguage([(code) => import(`./messages/${code}.js`)]);
document.title = t('board.title');
const link = new ClassLink(`${socketBase()}/ws/board`);
const panel = new Panel(find('panel'), () => [...link.robots.values()]);
const FEW = 10;
/** @type {Map<number, Card>} */
const cards = new Map();
/** @type {Set<number>} */
const inView = new Set();
let showsCodes = false;

const there = h('small', { role: 'status' });
const [place, stop] = makeStop(() => link.stop(), '', t('board.stop_all'));
listenForStop({ stop: () => link.stop(), mayMove: () => !link.isOpen || [...link.robots.values()].some(({ mode }) => mode !== null && mode !== 'stopped') });
const releaseAll = h('button', { type: 'button', disabled: true, onclick: () => link.release() }, t('board.release_all'));
const views = ['pictures', 'codes'].map((view) => h('button', {
  type: 'button', role: 'radio', 'aria-checked': String(view === 'pictures'), 'data-view': view,
  onclick: () => choose(view),
}, t(`board.view.${view}`)));
append(find('bar'), [
  h('img', { class: 'plate', alt: '', src: 'icons/plate.svg' }),
  h('div', { class: 'name' }, h('h1', {}, t('board.class')), there),
  h('div', { class: 'segments', role: 'radiogroup', 'aria-label': t('board.views') }, ...views),
  h('button', { type: 'button', onclick: () => panel.open('all') }, t('board.class_settings')),
  releaseAll, place, stop,
]);
say(find('empty'), t('board.searching'));
// A robot's panel never reaches above the lower edge of the bar, so that it does not cover STOP.
new ResizeObserver(() => document.body.style.setProperty('--bar', `${find('bar').getBoundingClientRect().bottom + 8}px`)).observe(find('bar'));

/** @param {string} view */
function choose(view) {
  showsCodes = view === 'codes';
  for (const button of views) button.setAttribute('aria-checked', String(button.dataset.view === view));
  document.body.dataset.view = view;
  for (const robot of link.robots.values()) cards.get(robot.number)?.show(robot, showsCodes);
  watch();
}

/** Request pictures only for cards on which they are visible: not on a hidden page, and not while codes are shown. */
function watch() {
  const numbers = document.hidden || showsCodes ? [] : [...inView].sort((a, b) => a - b);
  if (numbers.join() !== link.watched.join()) link.watch(numbers);
}

const sight = new IntersectionObserver((entries) => {
  for (const { target, isIntersecting } of entries) {
    const number = Number(/** @type {HTMLElement} */ (target).dataset.number);
    isIntersecting ? inView.add(number) : inView.delete(number);
  }
  watch();
});

/** @param {Robot} robot */
function cardOf(robot) {
  let card = cards.get(robot.number);
  if (!card) {
    card = new Card(robot.number, { stop: (number) => link.stop(number), release: (number) => link.release(number), open: (number) => panel.open(number) });
    cards.set(robot.number, card);
    find('robots').append(card.element);
    sight.observe(card.element);
  }
  return card;
}

link.addEventListener('news', (event) => {
  for (const robot of /** @type {CustomEvent<Robot[]>} */ (event).detail) {
    cardOf(robot).show(robot, showsCodes);
    panel.note(robot);
  }
  summarize();
});

link.addEventListener('strangers', (event) => {
  const { count, some } = /** @type {CustomEvent<{count: number, some: {address: string, status: string, detail: string}[]}>} */ (event).detail;
  const list = find('strangers');
  list.hidden = count === 0;
  say(/** @type {HTMLElement} */ (list.firstElementChild), t('board.strangers', { n: count }));
  const lines = some.map(({ address, status, detail }) => h('li', {}, `${address} · ${t(`board.status.${status}`)} · ${detail}`));
  fill(/** @type {HTMLElement} */ (list.lastElementChild), ...lines);
});

link.addEventListener('pictures', async (event) => {
  const pictures = /** @type {CustomEvent<Map<number, import('../js/protocol.js').Picture>>} */ (event).detail;
  await Promise.all([...pictures].map(([number, picture]) => cards.get(number)?.draw(picture)));
  link.drawn();
});

link.addEventListener('gone', (event) => {
  for (const number of /** @type {CustomEvent<number[]>} */ (event).detail) {
    if (panel.subject === number) panel.close();
    cards.get(number)?.element.remove();
    cards.delete(number);
  }
  summarize();
});

link.addEventListener('link', () => {
  if (link.isOpen) panel.close(); // a restarted board may number its robots differently
  summarize();
});
document.addEventListener('visibilitychange', watch);

function summarize() {
  const robots = [...link.robots.values()];
  find('empty').hidden = robots.length > 0;
  find('robots').classList.toggle('few', robots.length <= FEW);
  say(there, t('board.there', { n: robots.filter(({ status }) => status === 'there').length, of: robots.length }));
  releaseAll.disabled = !robots.some(({ stop_held_by: isHeld }) => isHeld);
  const missed = robots.filter(({ stop: how }) => how === 'not_reached').map(({ name }) => name);
  const lines = [];
  if (!link.isOpen && robots.length) lines.push(t('board.board_away'));
  if (missed.length) lines.push(t('board.missed', { names: missed.join(', ') }));
  const again = robots.filter(({ release_refused: isRefused }) => isRefused).map(({ name }) => name);
  if (again.length) lines.push(t('board.newer_stop', { names: again.join(', ') }));
  const loud = find('loud');
  if (loud.textContent !== lines.join('')) fill(loud, ...lines.map((line) => h('p', {}, line)));
  layStops();
}

link.connect();
