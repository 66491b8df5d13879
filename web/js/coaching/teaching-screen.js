// <teaching-screen>: the screen "Am I teaching well?", with the agreement and the share of each move.

import { ask } from '../api.js';
import { append, fill, h, icon, say, svg } from '../dom.js';
import { count, percent, t } from '../i18n.js';
import { Screen, text } from '../components/screen.js';
import { byPlace } from '../moves.js';
import { askReadiness } from './readiness.js';
import { drawReadiness } from './readiness-view.js';

const WIDTH = 400;
const HEIGHT = 190;

export class TeachingScreen extends Screen {
  build() {
    /** @type {number | undefined} */
    this.drawn = undefined;
    this.readiness = h('div', { class: 'panel stack' });
    this.chart = h('figure', { class: 'panel chart' });
    this.moves = h('div', { class: 'panel bars', role: 'list' });
    this.alike = h('div', { class: 'panel stack', hidden: true });
    append(this, [
      h('h2', {}, t('ready.title')), this.readiness,
      h('h2', {}, t('teaching.agreement')), this.chart,
      h('h2', {}, t('teaching.moves')), this.moves,
      h('div', { class: 'row' },
        h('a', { class: 'button', href: '#undo' }, icon('undo'), t('screen.undo')),
        h('a', { class: 'button', href: '#gallery' }, t('screen.gallery'))),
      this.alike,
      h('h2', {}, t('outdate.title')), h('p', { class: 'hint' }, t('outdate.lead')),
      h('div', { class: 'row' }, h('button', { type: 'button', onclick: () => this.outdate() }, t('outdate.say'))),
    ]);
    this.watch(['robot'], ({ robot }) => robot && this.render(robot));
    return this.every(2000, () => this.refreshIfTaught());
  }

  /** Request the curve only if there are new examples, because only these change it. */
  async refreshIfTaught() {
    const lessons = this.page?.store.state.robot?.lessons;
    if (this.drawn === lessons && lessons !== undefined) return;
    this.drawn = lessons;
    await this.refresh();
  }

  async refresh() {
    const [teaching, readiness, word] = await Promise.all([
      ask('GET', 'api/teaching').catch(() => null), askReadiness(true), ask('GET', 'api/teaching/alike').catch(() => null)]);
    if (!this.isConnected) return;
    if (!teaching || !readiness) this.drawn = undefined; // a request has failed, so try again at the next change
    if (teaching && !this.page?.store.state.lead) drawAgreement(/** @type {HTMLElement} */ (this.chart), teaching);
    if (word) this.drawAlike(word);
    if (readiness) drawReadiness(/** @type {Element} */ (this.readiness), readiness);
  }

  /** The switch "left and right are alike". If only one side was taught, the switch is shown as a question. @param {{ alike: boolean, possible: boolean, one_sided: boolean }} word */
  drawAlike(word) {
    const panel = /** @type {HTMLElement} */ (this.alike);
    panel.hidden = !word.possible;
    const box = h('input', { type: 'checkbox', checked: word.alike, onchange: () => this.sayAlike(box.checked) });
    fill(panel, h('label', { class: 'choice' }, box, h('span', {}, t('alike.say'))),
      h('p', { class: 'hint' }, t(word.one_sided && !word.alike ? 'alike.ask' : 'alike.lead')));
  }

  /** @param {boolean} alike */
  async sayAlike(alike) {
    await this.attempt(() => ask('POST', 'api/teaching/alike', { alike }));
    this.drawn = undefined;
    await this.refreshIfTaught();
  }

  async outdate() {
    await this.attempt(async () => {
      await ask('POST', 'api/teaching/outdate');
      this.page?.toast(t('outdate.done'), { label: t('undo'), act: () => this.attempt(() => ask('POST', 'api/gallery/undo')) });
    });
  }

  /** @param {import('../protocol.js').RobotState} robot */
  render(robot) {
    const moves = /** @type {HTMLElement} */ (this.moves);
    if (moves.dataset.stamp === JSON.stringify(robot.taught)) return;
    moves.dataset.stamp = JSON.stringify(robot.taught);
    fill(moves, ...byPlace(Object.keys(robot.taught)).map((name) => bar(name, robot)));
  }
}

/** @param {string} move @param {import('../protocol.js').RobotState} robot */
function bar(move, robot) {
  const n = robot.taught[move] ?? 0;
  const share = robot.lessons ? n / robot.lessons : 0;
  const fillBar = h('i');
  fillBar.style.transform = `scaleX(${share})`;
  return h('div', { role: 'listitem', class: 'bar-row' },
    h('span', { class: 'bar-name' }, icon(move), t(`move.${move}`)),
    h('span', { class: 'track', 'aria-hidden': 'true' }, fillBar),
    h('span', { class: 'bar-figure' }, `${count(n)} · ${percent(share)}`));
}

/** @param {HTMLElement} figure @param {{history: [number, number][], lessons: number, agreement: number | null}} teaching */
function drawAgreement(figure, { history, lessons, agreement }) {
  if (history.length < 2) {
    fill(figure, h('p', { class: 'hint' }, t('teaching.too_early')));
    return;
  }
  const last = Math.max(lessons, history[history.length - 1][0]);
  const x = (/** @type {number} */ n) => 44 + (n / last) * (WIDTH - 56);
  const y = (/** @type {number} */ share) => 10 + (1 - share) * (HEIGHT - 40);
  const points = history.map(([n, share]) => `${x(n).toFixed(1)},${y(share).toFixed(1)}`).join(' ');
  const lines = [0, 0.5, 1].flatMap((share) => [
    svg('line', { class: 'grid', x1: 44, x2: WIDTH - 12, y1: y(share), y2: y(share) }),
    text(38, y(share) + 5, 'end', percent(share)),
  ]);
  const chart = svg('svg', { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: 'img', 'aria-label': t('teaching.chart', { agreement: percent(agreement ?? 0), n: lessons }) },
    ...lines, svg('polyline', { class: 'curve', points }),
    text(44, HEIGHT - 6, 'start', '0'), text(WIDTH - 12, HEIGHT - 6, 'end', t('teaching.frames', { n: count(lessons) })));
  figure.replaceChildren(chart);
}

customElements.define('teaching-screen', TeachingScreen);
