// <teach-panel>: how good the robot is, how much it was taught, and what would help most.

import { append, h, say, svg } from '../dom.js';
import { teachingAdvice, urgentAdvice } from '../advice.js';
import { count, percent, t } from '../i18n.js';

const WIDTH = 200;
const HEIGHT = 34;

export class TeachPanel extends HTMLElement {
  /** @param {import('../page.js').Page} page */
  start(page) {
    this.agreement = h('strong', {}, '–');
    this.agreementWord = h('small', {}, t('agrees'));
    this.lessons = h('b', {}, '0');
    this.advice = h('p', { role: 'status' });
    this.curve = svg('polyline', { class: 'curve' });
    const all = svg('line', { class: 'goal', x1: 0, x2: WIDTH, y1: height(1), y2: height(1) });
    const chart = svg('svg', { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: 'none', 'aria-hidden': 'true' }, all, this.curve);
    append(this, [
      h('a', { href: '#teaching', class: 'summary', title: t('screen.teaching') },
        h('span', { class: 'big' }, this.agreement, this.agreementWord), chart,
        h('span', { class: 'taught' }, this.lessons, h('small', {}, t('frames_taught')))),
      this.advice,
    ]);
    page.store.watch(['robot', 'link', 'lesson', 'readiness', 'hint', 'notice', 'localStop', 'wheelAsked', 'wheelWaiting'], (state) => this.render(state));
    page.store.watch(['agreement'], (state) => this.curve?.setAttribute('points', points(state.agreement)));
  }

  /** @param {import('../store.js').PageState} state */
  render(state) {
    const { robot, lesson } = state;
    if (!robot) return;
    say(/** @type {Node} */ (this.agreement), robot.agreement === null ? '–' : percent(robot.agreement));
    say(/** @type {Node} */ (this.lessons), count(robot.lessons));
    if (lesson?.mode) {
      const left = minutes(lesson.left_s);
      say(/** @type {Node} */ (this.advice), t(`lesson.now_${lesson.phase}`, { left, n: lesson.trial }));
      return;
    }
    if (urgentAdvice(state)) {
      say(/** @type {Node} */ (this.advice), ''); // one thing at a time: it is said over the picture
      return;
    }
    const { key, move, ...values } = teachingAdvice(robot, state.readiness);
    say(/** @type {Node} */ (this.advice), t(key, { moves: move ? t(`moves.${move}`) : '', ...values }));
  }
}

/** @param {number} seconds */
export function minutes(seconds) {
  const whole = Math.max(0, Math.ceil(seconds));
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, '0')}`;
}

/** @param {number} share */
const height = (share) => HEIGHT - 2 - share * (HEIGHT - 4);

/** @param {number[]} shares */
export function points(shares) {
  const step = WIDTH / Math.max(1, shares.length - 1);
  return shares.map((share, i) => `${(i * step).toFixed(1)},${height(share).toFixed(1)}`).join(' ');
}

customElements.define('teach-panel', TeachPanel);
