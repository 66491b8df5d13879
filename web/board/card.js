// One robot on the board: picture or QR code, driver, agreement, and a STOP button.

import { decode } from '../js/picture.js';
import { h, icon, say } from '../js/dom.js';
import { language, percent, t } from '../js/i18n.js';

/** @typedef {import('./class-link.js').Robot} Robot */

/** A robot's program should answer within this time after its start. If ten programs start at once on a slow computer, each takes longer. */
const STARTING_MS = 30000;

/**
 * The key of the message that says who drives a robot.
 * @param {Robot} robot
 * @param {number} silentMs  time since the robot was last reached
 */
export function who(robot, silentMs = Infinity) {
  if (robot.status === 'away' && silentMs < STARTING_MS) return 'board.status.connecting';
  if (robot.status !== 'there') return `board.status.${robot.status}`;
  if (robot.stop_held_by) return 'board.who.held';
  if (robot.emergency) return 'board.who.stopped';
  if (robot.asks_pilot) return 'board.who.asks';
  return `board.who.${robot.driven_by ?? 'nobody'}`;
}

export class Card {
  /** @param {number} number @param {{stop: (number: number) => void, release: (number: number) => void, open: (number: number) => void}} acts */
  constructor(number, acts) {
    this.number = number;
    this.canvas = h('canvas', { class: 'seen', width: 160, height: 120, 'aria-hidden': 'true' });
    this.code = h('img', { class: 'code', alt: '', hidden: true });
    this.name = h('h2');
    this.chip = h('p', { class: 'chip' });
    this.signs = { nobody: icon('nobody'), pilot: icon('pilot'), robot: icon('robot') };
    this.chipText = h('span');
    this.figures = h('p', { class: 'figures' });
    this.why = h('p', { class: 'why' });
    this.stop = h('button', { class: 'halt', type: 'button' }, t('board.stop'));
    this.more = h('button', { type: 'button', onclick: () => acts.open(number) }, icon('more'));
    // STOP acts when it is pressed, not when it is released. A key press arrives as a click without a pointer.
    this.stop.addEventListener('pointerdown', () => acts.stop(number));
    this.stop.addEventListener('click', (event) => event.detail === 0 && acts.stop(number));
    this.release = h('button', { class: 'release', type: 'button', hidden: true, onclick: () => acts.release(number) }, t('board.release'));
    this.element = h('article', { class: 'robot', 'data-number': number },
      h('div', { class: 'view' }, this.canvas, this.code, this.why),
      h('div', { class: 'title' }, h('i', { class: 'dot' }), this.name),
      h('div', { class: 'facts' }, this.chip, this.figures),
      h('div', { class: 'acts' }, this.stop, this.more),
      this.release);
    this.shown = '';
    this.madeMs = performance.now();
    this.isDrawing = false;
  }

  /** @param {Robot} robot @param {boolean} showsCode */
  show(robot, showsCode) {
    const by = robot.status === 'there' ? robot.driven_by ?? 'nobody' : 'nobody';
    this.element.dataset.by = by;
    this.element.dataset.status = robot.status;
    this.element.dataset.stop = robot.stop ?? '';
    this.element.dataset.colour = robot.colour ?? 'grey';
    this.element.classList.toggle('halted', robot.status === 'there' && Boolean(robot.emergency));
    say(this.name, robot.name);
    this.element.setAttribute('aria-label', robot.name);
    this.stop.setAttribute('aria-label', t('board.stop_one', { name: robot.name }));
    this.release.setAttribute('aria-label', t('board.release_one', { name: robot.name }));
    this.release.hidden = robot.status !== 'there' || !robot.stop_held_by; // hidden but not removed, so that STOP does not move
    this.more.setAttribute('aria-label', t('board.more', { name: robot.name }));
    if (this.shown !== by) {
      this.shown = by;
      this.chip.replaceChildren(this.signs[by], this.chipText);
    }
    if (robot.status === 'there') this.madeMs = -Infinity;
    const how = who(robot, performance.now() - this.madeMs);
    say(this.chipText, t(robot.stop === 'not_reached' ? 'board.not_reached' : robot.stop === 'asked' ? 'board.stopping' : how));
    say(this.figures, robot.status === 'there' ? figures(robot).join(' · ') : '');
    say(this.why, robot.status === 'there' ? robot.fault ?? '' : how === 'board.status.connecting' ? '' : robot.detail);
    this.showCode(robot, showsCode);
  }

  /** @param {Robot} robot @param {boolean} isWanted */
  showCode(robot, isWanted) {
    const isShown = isWanted && robot.status === 'there' && robot.invitations > 0;
    this.canvas.hidden = isWanted;
    this.code.hidden = !isShown;
    if (!isShown) return;
    this.code.alt = t('board.code_of', { name: robot.name });
    const source = codeOf(robot);
    if (this.code.getAttribute('src') !== source) this.code.src = source;
  }

  /** @param {import('../js/protocol.js').Picture} picture */
  async draw(picture) {
    if (this.isDrawing) return;
    this.isDrawing = true;
    const bitmap = await decode(picture).catch(() => null);
    this.isDrawing = false;
    if (!bitmap) return;
    const { canvas } = this;
    if (canvas.width !== bitmap.width) canvas.width = bitmap.width;
    if (canvas.height !== bitmap.height) canvas.height = bitmap.height;
    canvas.getContext('2d')?.drawImage(bitmap, 0, 0);
    canvas.dataset.frames = String(Number(canvas.dataset.frames ?? 0) + 1);
    if ('close' in bitmap) bitmap.close();
  }
}

/** The address of a robot's newest QR code. @param {Robot} robot */
export const codeOf = (robot) => `api/robots/${robot.number}/qr.svg?${robot.invitations}&at=${encodeURIComponent(robot.page)}`;

/** @param {Record<string, string | number>} values */
const plain = (values) => Object.fromEntries(Object.entries(values).map(([name, value]) => [name, value.toLocaleString(language, { maximumFractionDigits: 1 })]));

/** @param {Robot} robot @returns {string[]} */
export function figures(robot) {
  const found = [];
  if (robot.agreement !== null) found.push(t('board.agrees', { share: percent(robot.agreement) }));
  else if (robot.lessons === 0) found.push(t('board.untaught'));
  for (const [what, values] of Object.entries(robot.shown ?? {})) found.push(t(`board.shown.${what}`, plain(values)));
  if (robot.battery !== null) found.push(t('board.battery', { share: percent(robot.battery) }));
  const isHere = /^https?:\/\/(127\.|localhost|\[::1\])/.test(robot.page);
  const isSlow = robot.mode !== 'stopped' && robot.link && robot.link !== 'good'; // a slow link does not matter while the robot stands still
  if (robot.mode !== 'stopped' && robot.busy || (isHere && isSlow)) found.push(t('board.busy'));
  else if (isSlow) found.push(t('board.link_slow'));
  if (robot.delay_ms !== null) found.push(t('board.delay', { ms: Math.round(robot.delay_ms) }));
  return found;
}

