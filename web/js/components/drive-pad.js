// <drive-pad>: the directions to hold, Undo, and the emergency stop.
//
// Each finger is tracked separately and may slide from one direction to another.
// A finger that slides off the pad lets go.
// After a stop, a phone call or a rotation of the screen, the pilot must lift a finger and press again; a small movement of the finger is not enough.

import { append, fill, h, hasLetGo, icon } from '../dom.js';
import { t } from '../i18n.js';
import { isEnter } from '../inputs/key-name.js';
import { inColumns, isOwn } from '../moves.js';
import { addressOf } from '../parts.js';
import { makeStop } from '../stop.js';

const SLACK_PX = 24;
const TAP_MS = 500;

export class DrivePad extends HTMLElement {
  /** @type {HTMLElement[]} made when it is first needed */
  sticks = [];
  /** @type {Set<number>} fingers that may drive: pressed since the last time everything was released */
  fingers = new Set();
  /** @type {number | null} the finger that activates tilt */
  tilting = null;
  /** @type {import('../inputs/tilt.js').Tilt | null} loaded only if tilt is used */
  tilt = null;

  /** @param {import('../page.js').Page} page */
  start(page) {
    this.page = page;
    this.sizes = new ResizeObserver(() => this.measure());
    this.moves = h('div', { class: 'moves', role: 'group', 'aria-label': t('pad') });
    this.undo = h('a', { class: 'button undo', href: addressOf('undo') }, icon('undo'), t('undo'));
    const stop = makeStop(() => page.stop(), '', h('span', { class: 'square', 'aria-hidden': 'true' }), t('emergency_stop'));
    append(this, [this.moves, this.undo, ...stop]);
    page.store.watch(['moves', 'hasStick'], ({ moves, hasStick }) => this.build(moves, hasStick));
    page.store.watch(['held', 'robot', 'link'], (state) => this.render(state));
    this.follow(this.moves);
  }

  /** @param {string[]} moves @param {boolean} hasStick */
  build(moves, hasStick) {
    const page = /** @type {import('../page.js').Page} */ (this.page);
    const useTilt = page.preferences.tilt;
    if (useTilt) import('../inputs/tilt.js').then(({ Tilt }) => this.useTilt(new Tilt(page.helm)), () => {});
    if (hasStick && !this.sticks.length) {
      import('../inputs/thumb-stick.js').then(({ makeStick }) => this.useStick(makeStick), () => {});
      hasStick = false; // show arrows until the thumb stick's code has loaded
    }
    const controls = hasStick ? this.sticks : moves.map((move) => this.makeButton(move));
    fill(/** @type {Element} */ (this.moves), ...controls,
      useTilt ? h('button', { class: 'move tilt', type: 'button', 'data-move': 'tilt' }, icon('tilt'), t('tilt_hold')) : null);
    this.moves?.classList.toggle('sticks', hasStick);
    this.sizes?.disconnect(); // measure again, because the size of Undo follows the width of its column, and the size of words follows the text size
    for (const sized of [this.undo, this.querySelector('.move span')]) if (sized) this.sizes?.observe(sized);
    this.arrange(hasStick ? [] : moves, Boolean(useTilt), hasStick);
  }

  /** If a word is wider than its button, only the symbols are shown (drive.css), so that no word is broken. */
  measure() {
    const { classList } = /** @type {HTMLElement} */ (this.moves);
    classList.remove('signs');
    const isBroken = [...this.querySelectorAll('.move')].some((move) => move.scrollWidth > move.clientWidth);
    classList.toggle('signs', isBroken);
  }

  /** Tell the layout (drive.css) which controls need room. @param {string[]} moves @param {boolean} useTilt @param {boolean} hasStick */
  arrange(moves, useTilt, hasStick) {
    const spins = moves.some((move) => move.startsWith('spin'));
    const isMany = moves.length > 4;
    const inTwos = moves.filter((move) => move !== 'forward' && move !== 'backward').length;
    const columns = isMany && !useTilt && moves.some(isOwn) ? inColumns(moves) : null;
    for (const button of /** @type {NodeListOf<HTMLElement>} */ (this.querySelectorAll('.move'))) {
      button.style.setProperty('--area', columns?.areas.get(button.dataset.move ?? '') ?? '');
    }
    const rows = columns ? columns.rows : isMany ? Math.ceil(moves.length / 3) : moves.length - inTwos + Math.ceil(inTwos / 2);
    const is = { many: isMany, placed: columns !== null, own: moves.some(isOwn) || (useTilt && spins), spins, backs: moves.includes('backward'), tilts: useTilt };
    for (const [name, isOn] of Object.entries(is)) this.moves?.classList.toggle(name, isOn);
    const pad = /** @type {HTMLElement} */ (this.parentElement);
    const count = hasStick ? 'var(--stick-rows, 3)' : rows;
    pad.style.setProperty('--pad-rows', `calc(${count} + ${useTilt ? 1 : 0})`);
    pad.classList.toggle('crowded', is.own || spins || is.backs || useTilt);
    pad.classList.toggle('shares', is.backs && !isMany && !spins); // in a low window, Back shares a row with the other moves
    this.measure();
  }

  /** @param {string} move */
  makeButton(move) {
    const source = `key on ${move}`;
    const helm = this.page?.helm;
    return h('button', {
      class: 'move', type: 'button', 'data-move': move, 'aria-pressed': 'false',
      onkeydown: (/** @type {KeyboardEvent} */ event) => {
        if (!isEnter(event)) return;
        event.preventDefault(); // otherwise the browser would also click, and the click would end the move
        if (!event.repeat) helm?.press(source, move);
      },
      onkeyup: () => helm?.release(source),
      onblur: () => helm?.release(source),
      // A screen reader only sends a click, which cannot hold a button: hold the move for a moment.
      onclick: (/** @type {PointerEvent} */ event) => {
        if (event.pointerType || event.detail) return;
        helm?.press(source, move);
        setTimeout(() => helm?.release(source), TAP_MS);
      },
    }, icon(move), h('span', {}, t(`move.${move}`)));
  }

  /** @param {HTMLElement} moves */
  follow(moves) {
    const helm = /** @type {import('../helm.js').Helm} */ (this.page?.helm);
    const letGo = (/** @type {number} */ finger) => {
      helm.release(`finger ${finger}`);
      if (finger !== this.tilting) return;
      this.tilting = null;
      this.tilt?.letGo();
    };
    const lift = (/** @type {number} */ finger) => this.fingers.delete(finger) && letGo(finger);
    const liftAll = () => this.fingers.forEach(lift);
    moves.addEventListener('pointerdown', (event) => {
      const move = moveAt(event);
      if (!move || (event.pointerType === 'mouse' && event.button !== 0)) return;
      event.preventDefault();
      moves.setPointerCapture(event.pointerId);
      this.fingers.add(event.pointerId);
      this.press(event.pointerId, move);
    });
    moves.addEventListener('pointermove', (event) => {
      if (hasLetGo(event)) lift(event.pointerId);
      if (!this.fingers.has(event.pointerId) || event.pointerId === this.tilting) return;
      const move = moveAt(event);
      if (move && move !== 'tilt') helm.press(`finger ${event.pointerId}`, move);
      else if (!isNear(moves, event)) letGo(event.pointerId);
    });
    for (const type of /** @type {const} */ (['pointerup', 'pointercancel', 'lostpointercapture'])) {
      moves.addEventListener(type, ({ pointerId }) => lift(pointerId));
    }
    helm.addEventListener('freed', liftAll);
    addEventListener('resize', liftAll);
    this.addEventListener('contextmenu', (event) => event.preventDefault());
  }

  /** Show the thumb stick once its code has loaded, if it is still wanted. @param {typeof import('../inputs/thumb-stick.js').makeStick} makeStick */
  useStick(makeStick) {
    const page = /** @type {import('../page.js').Page} */ (this.page);
    this.sticks = ['left', 'right'].map((side) => makeStick(page, side));
    this.build(page.store.state.moves, page.store.state.hasStick);
  }

  /** Use tilting once its code has loaded; a finger may already hold its button. @param {import('../inputs/tilt.js').Tilt} tilt */
  useTilt(tilt) {
    if (this.tilt) return;
    this.tilt = tilt;
    if (this.tilting !== null) tilt.hold();
  }

  /** @param {number} pointerId @param {string} move */
  press(pointerId, move) {
    if (this.page?.preferences.vibrate) navigator.vibrate?.(12);
    if (move === 'tilt') {
      this.tilting = pointerId;
      this.tilt?.hold();
    } else this.page?.helm.press(`finger ${pointerId}`, move);
  }

  /** @param {import('../store.js').PageState} state */
  render({ held, robot, link }) {
    const byRobot = link === 'open' && robot?.driven_by === 'robot' ? robot.action : null;
    for (const button of this.querySelectorAll('.move')) {
      const move = button.getAttribute('data-move');
      button.classList.toggle('held', move === held);
      button.classList.toggle('robot', !held && move === byRobot);
      button.setAttribute('aria-pressed', String(move === held));
    }
    this.classList.toggle('idle', link !== 'open' || !robot?.you_are_pilot || robot.mode === 'stopped');
  }
}

/** @param {PointerEvent} event */
function moveAt(event) {
  const under = document.elementFromPoint(event.clientX, event.clientY);
  return under?.closest('.move')?.getAttribute('data-move') ?? null;
}

/** True if the finger is on a button or in a gap between buttons. @param {Element} moves @param {PointerEvent} event */
function isNear(moves, event) {
  return [...moves.children].some((button) => {
    const box = button.getBoundingClientRect();
    return event.clientX > box.left - SLACK_PX && event.clientX < box.right + SLACK_PX &&
      event.clientY > box.top - SLACK_PX && event.clientY < box.bottom + SLACK_PX;
  });
}

customElements.define('drive-pad', DrivePad);
