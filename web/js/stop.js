// The emergency stop is in the browser's top layer, above everything else.
// The button reacts to any finger on it, no matter whether the finger was pressed there or slid there, or another element has captured it.
//
// Each button has a placeholder in the page's layout and is positioned exactly over it.
// A press is recognised by its position on the screen, before any element gets the event, so no element can intercept it.

import { h } from './dom.js';

const AGAIN_MS = 500; // pointer, touch and click events within this time report the same press

/** @typedef {{button: HTMLElement, place: HTMLElement, box: DOMRect | null}} Stop */

/** @type {Stop[]} */
const stops = [];
/** @type {(() => void) | null} */
let act = null;
let pressedMs = -Infinity;

/**
 * Make a stop button and its placeholder in the layout; insert both into the page, side by side.
 * @param {() => void} press  stops the robot
 * @param {string} kind  more classes, such as `small`
 * @param {...(Node | string)} label
 * @returns {[HTMLElement, HTMLElement]} place and button
 */
export function makeStop(press, kind, ...label) {
  const place = h('span', { class: `stop-place ${kind}`, 'aria-hidden': 'true' }, ...label.map((part) => (part instanceof Node ? part.cloneNode(true) : part)));
  const button = h('button', { class: `stop ${kind}`, type: 'button', popover: 'manual', onclick: pressed }, ...label);
  stops.push({ button, place, box: null });
  if (!act) listen();
  act = press;
  watcher.observe(place);
  return [place, button];
}

/** Position each button over its placeholder; a button with a hidden placeholder is hidden too. */
export function layStops() {
  for (const stop of stops) {
    const box = stop.place.getBoundingClientRect();
    const isShown = box.width > 0 && box.height > 0;
    stop.box = isShown ? box : null;
    if (isShown) {
      const { style } = stop.button;
      style.left = `${box.left}px`;
      style.top = `${box.top}px`;
      style.width = `${box.width}px`;
      style.height = `${box.height}px`;
    }
    stop.button.classList.toggle('shown', isShown);
    raise(stop.button, isShown);
  }
}

/** @param {HTMLElement} button @param {boolean} isShown */
function raise(button, isShown) {
  if (!button.showPopover || !button.isConnected) return; // a browser without a top layer uses the z-index
  if (isShown !== button.matches(':popover-open')) isShown ? button.showPopover() : button.hidePopover();
}

const watcher = new ResizeObserver(layStops);

function listen() {
  for (const element of document.querySelectorAll('body, header, main, #drive > *, toast-bar')) watcher.observe(element);
  new MutationObserver(layStops).observe(document.body, { attributes: true, attributeFilter: ['data-screen'] });
  addEventListener('resize', layStops);
  addEventListener('scroll', layStops, { capture: true, passive: true });
  document.addEventListener('toggle', comeBack, true);
  const early = { capture: true, passive: true };
  addEventListener('pointerdown', feel, early);
  addEventListener('pointermove', (event) => event.buttons & 1 && feel(event), early);
  // Follow touch events, too, because a finger that scrolls sends no more pointer events.
  for (const type of /** @type {const} */ (['touchstart', 'touchmove'])) {
    addEventListener(type, ({ changedTouches }) => [...changedTouches].forEach((touch) => isUpon(touch) && pressed()), early);
  }
}

/** Move the buttons to the top again after another element has entered the top layer. @param {Event} event */
function comeBack(event) {
  if (stops.some(({ button }) => button === event.target)) return;
  for (const { button, box } of stops) {
    if (!box || !button.showPopover) continue;
    raise(button, false);
    raise(button, true);
  }
}

/** @param {PointerEvent} event */
function feel(event) {
  if (event.pointerType === 'mouse' && !(event.buttons & 1)) return;
  const way = event.getCoalescedEvents?.() ?? [];
  if ([event, ...way].some(isUpon)) pressed();
}

/** @param {{clientX: number, clientY: number}} point */
function isUpon({ clientX: x, clientY: y }) {
  return stops.some(({ box }) => box && x >= box.left && x <= box.right && y >= box.top && y <= box.bottom);
}

function pressed() {
  const nowMs = performance.now();
  if (nowMs - pressedMs < AGAIN_MS) return;
  pressedMs = nowMs;
  act?.();
}
