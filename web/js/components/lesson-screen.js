// <lesson-screen>: the paper's study: choose a trial, follow its progress, answer the
// closing question, and see how pilot and robot drove.

import { ask } from '../api.js';
import { append, fill, h, icon, svg } from '../dom.js';
import { count, language, t } from '../i18n.js';
import { drawRecordings } from './from-above.js';
import { Screen, segments } from './screen.js';
import { minutes } from './teach-panel.js';
import { text } from './teaching-screen.js';

const PHASES = ['teach', 'correct', 'alone'];
const SCALE = [1, 2, 3, 4, 5, 6, 7];

export class LessonScreen extends Screen {
  build() {
    this.trial = '1';
    this.teachSeconds = '90';
    this.body = h('div', { class: 'stack' });
    this.results = h('div', { class: 'stack' });
    append(this, [this.body, this.results]);
    this.watch(['lesson'], (state) => this.render(state.lesson));
    return Promise.all([this.page?.refreshLesson(), this.listResults()]);
  }

  /** @param {import('../store.js').LessonState | null} lesson */
  render(lesson) {
    if (lesson?.participant) lesson = null; // a session of the study has a screen of its own
    const body = /** @type {HTMLElement} */ (this.body);
    const stamp = lesson ? `${lesson.phase}/${lesson.result ? 1 : 0}` : 'none';
    if (body.dataset.stamp !== stamp) {
      body.dataset.stamp = stamp;
      fill(body, ...this.parts(lesson));
    }
    if (lesson) this.renderProgress(lesson);
  }

  /** @param {import('../store.js').LessonState | null} lesson */
  parts(lesson) {
    if (!lesson) return this.invitation();
    if (lesson.phase === 'question') return this.question();
    if (lesson.result) return [...this.outcome(lesson.result), this.again(), this.map(lesson.result.episodes ?? [])];
    return this.running(lesson);
  }

  invitation() {
    const trials = /** @type {[string, string][]} */ (['1', '2', '3'].map((n) => [n, t('lesson.trial', { n })]));
    const times = /** @type {[string, string][]} */ (['90', '180'].map((s) => [s, t('lesson.teach_time', { s })]));
    const hint = h('p', { class: 'hint' }, t(`lesson.trial_${this.trial}`));
    return [
      h('p', { class: 'lead' }, t('lesson.lead')),
      segments(t('lesson.which'), trials, this.trial ?? '1', (/** @type {string} */ trial) => {
        this.trial = trial;
        hint.textContent = t(`lesson.trial_${trial}`);
      }),
      hint,
      segments(t('lesson.how_long'), times, this.teachSeconds ?? '90', (/** @type {string} */ s) => (this.teachSeconds = s)),
      h('p', { class: 'hint' }, t('lesson.empty')),
      h('button', { type: 'button', class: 'primary wide', onclick: () => this.begin() }, t('lesson.begin')),
    ];
  }

  /** @param {import('../store.js').LessonState} lesson */
  running(lesson) {
    this.progress = PHASES.map((phase) => h('i'));
    this.left = PHASES.map(() => h('span', { class: 'bar-figure' }));
    const steps = PHASES.map((phase, i) => h('li', { class: phase === lesson.phase ? 'now' : '' },
      h('b', {}, `${i + 1}. ${t(`lesson.${phase}`)}`), /** @type {HTMLElement[]} */ (this.left)[i],
      h('span', { class: 'hint' }, t(`lesson.${phase}_how`)),
      h('span', { class: 'track', 'aria-hidden': 'true' }, /** @type {HTMLElement[]} */ (this.progress)[i])));
    return [
      h('p', { class: 'lead' }, t('lesson.running', { n: lesson.trial })),
      h('ol', { class: 'panel steps' }, ...steps),
      h('a', { class: 'button primary wide', href: '#drive' }, t('lesson.go_on')),
      h('button', { type: 'button', onclick: () => this.abandon() }, t('lesson.abandon')),
    ];
  }

  /** @param {import('../store.js').LessonState} lesson */
  renderProgress(lesson) {
    PHASES.forEach((phase, i) => {
      const bar = this.progress?.[i];
      const left = this.left?.[i];
      if (!bar || !left) return;
      bar.style.transform = `scaleX(${Math.min(1, lesson.done_s[phase] / lesson.wanted_s[phase])})`;
      left.textContent = minutes(lesson.wanted_s[phase] - lesson.done_s[phase]);
    });
  }

  question() {
    const choices = SCALE.map((n) => h('button', { type: 'button', onclick: () => this.answer(n), 'aria-label': `${n}, ${t(`lesson.scale_${n}`)}` }, String(n)));
    return [
      h('h2', {}, t('lesson.question')),
      h('div', { class: 'scale', role: 'group', 'aria-label': t('lesson.question') }, ...choices),
      h('div', { class: 'ends' }, h('small', {}, t('lesson.scale_1')), h('small', {}, t('lesson.scale_7'))),
    ];
  }

  /** @param {any} result */
  outcome(result) {
    return [
      h('p', { class: 'lead' }, result.ssd === null ? t('lesson.no_profile') : t('lesson.ssd', { ssd: result.ssd.toFixed(2) })),
      h('div', { class: 'profiles' }, ...result.moves.map((/** @type {string} */ move) => profile(result, move))),
      h('p', { class: 'hint' }, t('lesson.profile_how')),
      h('p', {}, t('lesson.facts', { n: count(result.lessons), i: count(result.interventions), a: result.answer })),
      h('a', { class: 'button', href: `/api/lesson/results/${result.id}.json`, download: '' }, t('lesson.download')),
    ];
  }

  /** The world from above, with the way of the whole trial: it comes late, so it is last. @param {string[]} episodes */
  map(episodes) {
    const place = h('figure', { class: 'panel chart map' });
    drawRecordings(place, episodes).catch(() => {}); // without its recordings there is no way to draw
    return place;
  }

  again() {
    return h('button', { type: 'button', class: 'primary wide', onclick: () => this.abandon() }, t('lesson.again'));
  }

  begin() {
    return this.attempt(async () => {
      const { lesson } = await ask('POST', '/api/lesson', { trial: Number(this.trial), teach_s: Number(this.teachSeconds) });
      this.page?.store.set({ lesson });
    });
  }

  abandon() {
    return this.attempt(async () => {
      this.page?.store.set({ lesson: (await ask('DELETE', '/api/lesson')).lesson });
      await this.listResults();
    });
  }

  /** @param {number} answer */
  answer(answer) {
    return this.attempt(async () => {
      await ask('POST', '/api/lesson/answer', { answer });
      await this.page?.refreshLesson();
      await this.listResults();
    });
  }

  async listResults() {
    const { results } = await ask('GET', '/api/lesson/results').catch(() => ({ results: [] }));
    if (!this.isConnected) return;
    const lines = results.map((/** @type {any} */ result) => h('a', { class: 'panel line', href: `/api/lesson/results/${result.id}.json`, download: '' },
      h('b', {}, t('lesson.trial', { n: result.trial })),
      h('span', {}, result.ssd === null ? '–' : `SSD ${result.ssd.toFixed(2)}`), h('span', {}, `${result.answer}/7`),
      h('small', {}, new Date(result.began_at_s * 1000).toLocaleString(language, { dateStyle: 'medium', timeStyle: 'short' }))));
    fill(/** @type {Element} */ (this.results), lines.length ? h('h2', {}, t('lesson.results')) : null, ...lines);
  }
}

/** One move's curves: how often it was made nearer than each distance. @param {any} result @param {string} move */
function profile(result, move) {
  const WIDTH = 340;
  const HEIGHT = 200;
  const x = (/** @type {number} */ m) => 40 + (m / 2) * (WIDTH - 56);
  const y = (/** @type {number} */ share) => 12 + (1 - share) * (HEIGHT - 44);
  const curve = (/** @type {'pilot' | 'robot'} */ who) => {
    const shares = /** @type {number[]} */ (result[who][move] ?? []).slice(0, Math.round(2 / result.step_m) + 1);
    return svg('polyline', { class: `curve ${who}`, points: shares.map((p, i) => `${x(i * result.step_m).toFixed(1)},${y(p).toFixed(1)}`).join(' ') });
  };
  const grid = [0, 0.5, 1].flatMap((share) => [svg('line', { class: 'grid', x1: 40, x2: WIDTH - 16, y1: y(share), y2: y(share) }), text(34, y(share) + 5, 'end', String(share))]);
  const metres = [0, 0.5, 1, 1.5, 2].map((m) => text(x(m), HEIGHT - 10, 'middle', m === 2 ? '2 m' : String(m)));
  const label = t('lesson.chart', { move: t(`move.${move}`), ssd: (result.ssd_per_move[move] ?? 0).toFixed(2) });
  const never = ['pilot', 'robot'].filter((who) => result[`never_by_${who}`].includes(move));
  return h('figure', { class: 'panel chart' },
    h('figcaption', {}, icon(move), h('b', {}, t(`move.${move}`)), h('span', { class: 'key pilot' }, t('lesson.you')), h('span', { class: 'key robot' }, t('lesson.robot'))),
    /** @type {any} */ (svg('svg', { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: 'img', 'aria-label': label }, ...grid, ...metres, curve('pilot'), curve('robot'))),
    ...never.map((who) => h('p', { class: 'hint' }, t(`lesson.never_${who}`))));
}

customElements.define('lesson-screen', LessonScreen);
