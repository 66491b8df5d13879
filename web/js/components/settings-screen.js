// <settings-screen>: the settings that a person changes on the page.

import { ask, askLong } from '../api.js';
import { append, fill, h } from '../dom.js';
import { LANGUAGES, chooseLanguage, language, percent, t } from '../i18n.js';
import { Tilt, hasTilt } from '../inputs/tilt.js';
import { partScreens, sectionsOf } from '../parts.js';
import { Screen, group, segments } from './screen.js';
import { byPlace, declare } from '../moves.js';

export class SettingsScreen extends Screen {
  build() {
    this.robot = h('div', { class: 'stack' });
    append(this, [this.robot, this.phone()]);
    return this.refresh();
  }

  /** The request of the last change. Each change waits for the previous one, so that no change overwrites a newer one. @type {Promise<any>} */
  putting = Promise.resolve();

  /** @param {string} path @param {object} words */
  put(path, words) {
    return (this.putting = this.putting.then(() => this.attempt(() => ask('PUT', path, words))));
  }

  async refresh() {
    const answers = await this.inOrder(this.attempt(() => Promise.all([
      askLong('api/settings'),
      sectionsOf('settings', this),
    ])));
    if (answers) this.renderRobot(answers[0], answers[1]);
  }

  /** @param {any} settings @param {(HTMLElement | null)[]} sections */
  renderRobot(settings, sections) {
    declare(settings.declared_moves);
    fill(/** @type {Element} */ (this.robot), this.identity(settings), ...sections, this.steering(settings), this.size(settings), this.speed(settings), this.moves(settings), this.camera(settings.camera));
  }

  /** @param {any} settings */
  identity({ name, colour, colours }) {
    const change = (/** @type {object} */ words) => this.put('api/settings', words).then(() => this.refresh());
    const field = h('input', { value: name, maxlength: 24, 'aria-label': t('home.name'), onchange: () => change({ name: field.value.trim() }) });
    const choice = h('select', { 'aria-label': t('settings.colour'), onchange: () => change({ colour: choice.value }) },
      ...colours.map((/** @type {string} */ c) => h('option', { value: c, selected: c === colour }, t(`colour.${c}`))));
    return group(t('settings.robot'), '', h('div', { class: 'row' }, field, choice));
  }

  /** @param {any} settings */
  steering({ takes_points: takesPoints }) {
    const page = /** @type {import('../page.js').Page} */ (this.page);
    const { hasStick, robotName } = page.store.state;
    if (!takesPoints) return null;
    const ways = /** @type {[string, string][]} */ ([['moves', t('settings.by_moves')], ['stick', t('settings.by_stick')]]);
    return group(t('settings.steering'), t('settings.steering_hint'), segments(t('settings.steering'), ways, hasStick ? 'stick' : 'moves', (way) => {
      page.preferences.chooseStick(robotName, way === 'stick');
      page.followPreferences();
    }));
  }

  /** @param {any} settings */
  size({ sizes, max_nodes: now, camera: { rate_hz: most } }) {
    // Show the rate only if the computer limits it, not if the camera does.
    const rate = (/** @type {number} */ hz) => (most && hz >= most ? t('settings.keeps_up') : t('settings.rate', { n: Math.max(1, Math.round(hz)) }));
    const options = sizes.map((/** @type {any} */ size) => h('label', { class: 'choice' },
      h('input', { type: 'radio', name: 'size', value: size.max_nodes, checked: size.max_nodes === now, onchange: () => this.begin({ max_nodes: size.max_nodes }) }),
      h('span', {}, t('images', { n: size.max_nodes })), h('small', {}, rate(size.rate_hz))));
    return group(t('settings.size'), t('settings.size_hint'), ...options);
  }

  /** @param {any} settings */
  speed({ speed }) {
    const shown = h('output', {}, percent(speed));
    const slider = h('input', {
      type: 'range', min: 30, max: 100, step: 5, value: Math.round(speed * 100), 'aria-label': t('settings.speed'),
      oninput: () => (shown.textContent = percent(Number(slider.value) / 100)),
      onchange: () => this.put('api/settings', { speed: Number(slider.value) / 100 }).then((done) => done || this.refresh()),
    });
    return group(t('settings.speed'), '', h('div', { class: 'slider' }, slider, shown));
  }

  /** @param {any} settings */
  moves({ possible_moves: possible, moves }) {
    const boxes = byPlace(possible).map((move) => {
      const box = h('input', { type: 'checkbox', value: move, checked: moves.includes(move) });
      box.addEventListener('change', () => this.begin({ moves: chosen() }));
      return box;
    });
    const chosen = () => boxes.filter((box) => box.checked).map((box) => box.value);
    return group(t('settings.moves'), t('settings.moves_hint'),
      ...boxes.map((box) => h('label', { class: 'choice' }, box, h('span', {}, t(`move.${box.value}`)))));
  }

  /** @param {any} camera */
  camera({ name, width, height, rate_hz: rate }) {
    const size = width ? `${width}×${height}` : '–';
    return group(t('settings.camera'), t('settings.camera_hint', { name, size, rate: Math.round(rate) }));
  }

  /** Start an empty model of another kind; the previous model is saved. @param {object} change */
  async begin(change) {
    const done = await this.put('api/settings', change);
    if (done) this.page?.toast(t('settings.begun'));
    await this.refresh();
  }

  phone() {
    const { preferences } = /** @type {import('../page.js').Page} */ (this.page);
    const tilt = h('input', { type: 'checkbox', checked: preferences.tilt, disabled: !hasTilt() });
    tilt.addEventListener('change', async () => {
      tilt.checked = tilt.checked && (await Tilt.allow());
      preferences.set('tilt', tilt.checked);
      this.page?.store.set({ moves: [...this.page.store.state.moves] });
    });
    const vibrate = h('input', { type: 'checkbox', checked: preferences.vibrate, onchange: () => preferences.set('vibrate', vibrate.checked) });
    const sound = h('input', { type: 'checkbox', checked: preferences.sound, onchange: () => preferences.set('sound', sound.checked) });
    const languages = h('select', { 'aria-label': t('settings.language'), onchange: () => chooseLanguage(languages.value) },
      ...Object.entries(LANGUAGES).map(([code, name]) => h('option', { value: code, selected: code === language, lang: code }, name)));
    const hints = h('button', { type: 'button', onclick: () => { preferences.set('hintsShown', []); location.hash = 'drive'; } }, t('settings.hints'));
    return h('div', { class: 'stack' }, group(t('settings.phone'), isSecureContext ? '' : t('settings.insecure'),
      h('label', { class: 'choice' }, tilt, h('span', {}, t('settings.tilt'))),
      h('label', { class: 'choice' }, vibrate, h('span', {}, t('settings.vibrate'))),
      h('label', { class: 'choice' }, sound, h('span', {}, t('settings.sound'))),
      h('label', { class: 'choice' }, h('span', {}, t('settings.language')), languages),
      hints), group(t('settings.keys'), t('settings.keys_hint'), ...this.pads()),
      ...Object.entries(partScreens()).flatMap(([name, { settings }]) => settings
        ? [group(t(settings.title), t(settings.hint), h('a', { class: 'button', href: `#${name}` }, t(`screen.${name}`)))] : []));
  }

  /** Button that forgets the directions shown for game pads; the page asks for them again when a pad is touched. */
  pads() {
    const { preferences } = /** @type {import('../page.js').Page} */ (this.page);
    if (!Object.keys(preferences.values.pads).length) return [];
    const forget = h('button', { type: 'button', onclick: () => { preferences.set('pads', {}); forget.remove(); } }, t('settings.pads'));
    return [forget];
  }
}

customElements.define('settings-screen', SettingsScreen);
