// <app-bar>: the robot's face and name, and the menu with the other screens and with figures about the connection.
// On every screen but the drive screen it also has the emergency stop.

import { append, h, icon, say, svg } from '../dom.js';
import { mood } from '../mood.js';
import { percent, t } from '../i18n.js';
import { makeStop } from '../stop.js';
import { partScreens } from '../parts.js';
import { sentence } from './teach-panel.js';

const SCREENS = ['drive'];
const LOW_BATTERY = 0.2;
/** @type {Record<string, string>} */
const MOUTHS = { listening: 'M57 49h10', sure: 'M50 46q12 9 24 0', unsure: 'M49 50q6-8 12 0t13 0', proud: 'M46 43q16 21 32 0z' };

export class AppBar extends HTMLElement {
  /** @param {import('../page.js').Page} page */
  start(page) {
    this.page = page;
    this.mouth = svg('path');
    this.plate = h('span', { class: 'plate', role: 'img' }, /** @type {any} */ (svg('svg', { viewBox: '0 0 96 96', 'aria-hidden': 'true' },
      svg('path', { class: 'l', d: 'M16 16h15v49h49v15H16z' }), svg('circle', { cx: 50, cy: 28, r: 5 }), svg('circle', { cx: 74, cy: 28, r: 5 }), this.mouth)));
    this.heading = h('h1');
    this.detail = h('small');
    this.figures = h('p', { class: 'figures' });
    this.back = h('a', { class: 'button quiet back', href: '#drive', 'aria-label': t('back') }, icon('back'));
    const stop = makeStop(() => page.stop(), 'small', t('emergency_stop'));
    this.button = h('button', {
      class: 'quiet', type: 'button', 'aria-label': t('menu'), 'aria-expanded': 'false',
      'aria-controls': 'menu', onclick: () => this.toggle(),
    }, icon('menu'));
    this.menu = this.makeMenu();
    append(this, [this.back, this.plate, h('div', { class: 'name' }, this.heading, this.detail),
      ...stop, this.button, this.menu]);
    page.store.watch(['robot', 'link', 'readiness', 'screen', 'delayMs', 'pictureAgeMs', 'robotName', 'lead'], (state) => this.render(state));
    addEventListener('keydown', (event) => event.key === 'Escape' && !this.menu?.hidden && (event.preventDefault(), this.toggle(false)));
    addEventListener('pointerdown', (event) => {
      if (event.target instanceof Node && !this.contains(event.target)) this.toggle(false);
    });
  }

  makeMenu() {
    this.links = [...SCREENS, ...Object.keys(partScreens()), 'settings'].map((screen) =>
      h('a', { href: `#${screen}`, onclick: () => this.toggle(false) }, t(`screen.${screen}`)));
    return h('nav', { id: 'menu', hidden: true, 'aria-label': t('menu') }, ...this.links, this.figures);
  }

  /** @param {boolean} [open] */
  toggle(open = this.menu?.hidden ?? false) {
    if (!this.menu || !this.button || this.menu.hidden === !open) return;
    if (!open && this.menu.contains(document.activeElement)) this.button.focus();
    this.menu.hidden = !open;
    this.button.setAttribute('aria-expanded', String(open));
    if (open && this.page) this.render(this.page.store.state);
  }

  /** @param {import('../store.js').PageState} state */
  render(state) {
    const onDrive = state.screen === 'drive';
    const robot = state.robot;
    this.classList.toggle('sub', !onDrive);
    say(/** @type {Element} */ (this.heading), onDrive ? state.robotName || t('app') : t(`screen.${state.screen}`));
    say(/** @type {Element} */ (this.detail), onDrive ? this.describe(state) : '');
    this.plate?.classList.toggle('off', robot?.mode === 'autonomous');
    const now = mood(state);
    if (this.plate?.dataset.mood !== now) {
      this.mouth?.setAttribute('d', MOUTHS[now]);
      this.plate?.setAttribute('aria-label', t(`mood.${now}`));
      if (this.plate) this.plate.dataset.mood = now;
    }
    if (this.menu?.hidden) return;
    say(/** @type {Element} */ (this.figures), this.list(state).join('\n'));
    const added = partScreens();
    for (const link of this.links ?? []) link.hidden = added[link.hash.slice(1)]?.isOffered(state) === false;
  }

  /** @param {import('../store.js').PageState} state */
  describe({ robot, link, lead }) {
    if (link !== 'open' || !robot) return t(link === 'lost' ? 'searching' : 'connecting');
    if (lead?.told) return sentence(lead.told);
    return robot.battery !== null && robot.battery < LOW_BATTERY ? `${t('figure.battery')} ${percent(robot.battery)}` : '';
  }

  /** The figures in the menu, for people who want to know more about the connection. @param {import('../store.js').PageState} state */
  list({ robot, link, delayMs, pictureAgeMs }) {
    if (link !== 'open' || !robot) return [];
    return [
      t('images', { n: robot.nodes }),
      `${t('figure.rate')}: ${Math.round(robot.cycle_hz)}`,
      pictureAgeMs !== null && `${t('figure.age')}: ${Math.round(pictureAgeMs)} ms`,
      delayMs !== null && `${t('figure.delay')}: ${Math.round(delayMs)} ms`,
      robot.battery !== null && `${t('figure.battery')}: ${percent(robot.battery)}`,
    ].filter(Boolean);
  }
}

customElements.define('app-bar', AppBar);
