// <teach-panel>: the robot's agreement, the number of examples, and one message.
// If no advice is urgent, the most useful advice is shown.

import { append, fill, h, say, settle, svg } from '../dom.js';
import { urgentAdvice, whatToSay } from '../advice.js';
import { celebrate } from '../celebration.js';
import { count, percent, t } from '../i18n.js';
import { addressOf } from '../parts.js';
import { stepButton } from './toast-bar.js';

const WIDTH = 200;
const HEIGHT = 34;
/** The agreement is shown from this number of pictures on, because a share of fewer pictures means little. */
const FEWEST = 20;

export class TeachPanel extends HTMLElement {
  /** @param {import('../page.js').Page} page */
  start(page) {
    this.page = page;
    this.agreement = h('strong', {}, '–');
    this.agreementWord = h('small', {}, t('agrees'));
    this.lessons = h('b', {}, '0');
    this.advice = h('p', { class: 'advice', role: 'status' });
    this.words = h('p');
    this.notice = h('div', { class: 'notice', role: 'status', hidden: true }, this.words);
    this.curve = svg('polyline', { class: 'curve' });
    const all = svg('line', { class: 'goal', x1: 0, x2: WIDTH, y1: height(1), y2: height(1) });
    const chart = svg('svg', { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: 'none', 'aria-hidden': 'true' }, all, this.curve);
    this.summary = h('a', { href: addressOf('teaching'), class: 'summary', title: t('screen.teaching') },
      h('span', { class: 'big' }, this.agreement, this.agreementWord), chart,
      h('span', { class: 'taught' }, this.lessons, h('small', {}, t('frames_taught'))));
    append(this, [this.summary, h('div', { class: 'says' }, this.advice, this.notice)]);
    page.store.watch(['robot', 'link', 'way', 'isWatching', 'lead', 'readiness', 'setback', 'told', 'hint', 'notice', 'toast', 'localStop', 'wheelAsked', 'wheelWaiting'], (state) => this.render(state));
    // The agreement is hidden from a pilot who is led by an extension.
    page.store.watch(['agreement', 'lead'], (state) => this.curve?.setAttribute('points', points(state.lead ? [] : state.agreement)));
  }

  /** @param {import('../store.js').PageState} state */
  render(state) {
    const { robot } = state;
    this.summary?.classList.toggle('early', !robot?.lessons);
    if (robot) {
      const { agreement, agreement_frames: frames } = robot;
      say(/** @type {Node} */ (this.agreement), agreement === null || frames < FEWEST || state.lead ? '–' : percent(agreement));
      say(/** @type {Node} */ (this.lessons), count(robot.lessons));
    }
    const isNoticed = this.renderNotice(state);
    // Show one message at a time. A message that has not changed stays as it is, so that no screen reader reads it out twice.
    const told = whatToSay(state);
    const text = isNoticed || !told ? '' : sentence(told);
    // A screen reader must not read out a clock every second.
    const live = told?.left_s === undefined ? 'polite' : 'off';
    if (this.advice?.getAttribute('aria-live') !== live) this.advice?.setAttribute('aria-live', live);
    say(/** @type {Node} */ (this.advice), text);
    this.celebrate(told?.key === 'advice.can' && !isNoticed, state.readiness?.stage !== 'ready');
  }

  /**
   * Celebrate once when the robot can drive by itself. A notice hides the celebration, but does not end it.
   * @param {boolean} isShown
   * @param {boolean} isOver
   */
  celebrate(isShown, isOver) {
    this.classList.toggle('ready', isShown);
    if (isOver) this.isMarked = false;
    if (!isShown || this.isMarked) return;
    this.isMarked = true;
    celebrate(this, /** @type {import('../page.js').Page} */ (this.page).preferences);
  }

  /** True if there is a notice. @param {import('../store.js').PageState} state */
  renderNotice(state) {
    const notice = /** @type {HTMLElement} */ (this.notice);
    const urgent = urgentAdvice(state);
    // A toast has priority over advice that is only informative.
    const toast = urgent && urgent.level !== 'info' ? null : state.toast;
    const advice = toast ? null : urgent;
    const text = toast?.text ?? (advice ? t(advice.key, advice.values) : '');
    const step = advice?.step ?? toast?.step?.label ?? '';
    const stamp = `${text}/${step}`;
    if (notice.dataset.stamp === stamp) return !notice.hidden;
    notice.dataset.stamp = stamp;
    notice.dataset.level = advice?.level ?? '';
    const hadFocus = notice.contains(document.activeElement);
    this.classList.toggle('noticing', Boolean(text));
    if (notice.hidden === Boolean(text)) {
      notice.hidden = !text;
      settle(/** @type {Element} */ (this.summary));
    }
    say(/** @type {Node} */ (this.words), text);
    if (notice.dataset.step !== step || toast) {
      notice.dataset.step = step;
      const page = /** @type {import('../page.js').Page} */ (this.page);
      const buttons = toast ? stepButton(page, toast) : step ? [h('button', { type: 'button', onclick: () => page.take(step) }, t(`step.${step}`))] : [];
      fill(notice, /** @type {Node} */ (this.words), ...buttons);
      buttons.forEach(settle);
    }
    if (hadFocus && !notice.contains(document.activeElement)) /** @type {HTMLElement | null} */ (document.querySelector('mode-bar [tabindex="0"]'))?.focus();
    return Boolean(text);
  }
}

/** @param {import('../advice.js').Told} told */
export function sentence({ key, move, left_s: s, ...values }) {
  return t(key, { moves: move ? t(`moves.${move}`) : '', ...(s === undefined ? {} : { left: minutes(s) }), ...values });
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
