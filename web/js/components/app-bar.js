// <app-bar>: the robot's plate and name, the link's figures, the way to the other screens; on all
// screens but the drive screen also the emergency stop.

import { append, fill, h, icon, say } from '../dom.js';
import { percent, t } from '../i18n.js';
import { makeStop } from '../stop.js';
import { minutes } from './teach-panel.js';

export const SCREENS = ['drive', 'gallery', 'teaching', 'lesson', 'study', 'home', 'settings'];

export class AppBar extends HTMLElement {
  shownFigures = '';

  /** @param {import('../page.js').Page} page */
  start(page) {
    this.page = page;
    this.plate = h('span', { class: 'plate', 'aria-hidden': 'true' }, 'L');
    this.heading = h('h1');
    this.detail = h('small');
    this.figures = h('div', { class: 'figures' });
    this.back = h('a', { class: 'button quiet back', href: '#drive', 'aria-label': t('back') }, icon('back'));
    const stop = makeStop(() => page.stop(), 'small', t('emergency_stop'));
    this.button = h('button', {
      class: 'quiet', type: 'button', 'aria-label': t('menu'), 'aria-expanded': 'false',
      'aria-controls': 'menu', onclick: () => this.toggle(),
    }, icon('menu'));
    this.menu = this.makeMenu();
    append(this, [this.back, this.plate, h('div', { class: 'name' }, this.heading, this.detail),
      this.figures, ...stop, this.button, this.menu]);
    page.store.watch(['robot', 'link', 'screen', 'delayMs', 'robotName', 'lesson'], (state) => this.render(state));
    addEventListener('keydown', (event) => event.key === 'Escape' && this.toggle(false));
    addEventListener('pointerdown', (event) => {
      if (event.target instanceof Node && !this.contains(event.target)) this.toggle(false);
    });
  }

  makeMenu() {
    const links = SCREENS.map((screen) =>
      h('a', { href: `#${screen}`, onclick: () => this.toggle(false) }, t(`screen.${screen}`)));
    return h('nav', { id: 'menu', hidden: true, 'aria-label': t('menu') }, ...links);
  }

  /** @param {boolean} [open] */
  toggle(open = this.menu?.hidden ?? false) {
    if (!this.menu || !this.button || this.menu.hidden === !open) return;
    this.menu.hidden = !open;
    this.button.setAttribute('aria-expanded', String(open));
  }

  /** @param {import('../store.js').PageState} state */
  render(state) {
    const onDrive = state.screen === 'drive';
    const robot = state.robot;
    this.classList.toggle('sub', !onDrive);
    say(/** @type {Element} */ (this.heading), onDrive ? state.robotName || t('app') : t(`screen.${state.screen}`));
    say(/** @type {Element} */ (this.detail), onDrive ? this.describe(state) : '');
    this.plate?.classList.toggle('off', robot?.mode === 'autonomous');
    const figures = this.list(state).filter(Boolean);
    const text = figures.map((figure) => /** @type {HTMLElement} */ (figure).textContent).join();
    if (this.shownFigures === text) return;
    this.shownFigures = text;
    fill(/** @type {Element} */ (this.figures), ...figures);
  }

  /** @param {import('../store.js').PageState} state */
  describe({ robot, link, lesson }) {
    if (link !== 'open' || !robot) return t(link === 'lost' ? 'searching' : 'connecting');
    if (lesson?.mode) return t(`lesson.now_${lesson.phase}`, { left: minutes(lesson.left_s), n: lesson.trial });
    const images = t('images', { n: robot.nodes });
    return robot.agreement === null ? images : `${images} · ${percent(robot.agreement)}`;
  }

  /** @param {import('../store.js').PageState} state */
  list({ robot, link, delayMs }) {
    if (link !== 'open' || !robot) return [];
    const figure = (/** @type {string} */ text, /** @type {string} */ name) =>
      h('span', { title: name }, h('span', { class: 'unseen' }, `${name} `), text);
    return [
      delayMs !== null && figure(`${Math.round(delayMs)} ms`, t('figure.delay')),
      figure(`${Math.round(robot.cycle_hz)}/s`, t('figure.rate')),
      robot.battery !== null && figure(percent(robot.battery), t('figure.battery')),
    ];
  }
}


customElements.define('app-bar', AppBar);
