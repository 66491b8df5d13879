// A thumb stick for proportional steering.
// The base of the stick does not move.
// The stick is released when the finger is lifted or leaves the stick, or when the browser cancels the touch.
// A change of the window's size, for example when the screen is turned, also releases the stick,
// because the stick would then point in a direction in which nobody has pushed it.

import { h, hasLetGo, svg } from '../dom.js';
import { t } from '../i18n.js';
import { fromStick } from '../points.js';

/** Distances from the middle, in radii of the stick: a thumb can grasp the stick within NEAR, and holds it within OFF. */
const NEAR = 1.2;
const OFF = 2;
const WAY = 26; // travel of the knob, in percent of the stick's width
const ARROWS = 'M43 11l7-6 7 6M11 43l-6 7 6 7M89 43l6 7-6 7';

/** @param {import('../page.js').Page} page @param {string} side  the side of the thumb */
export function makeStick(page, side) {
  const { helm } = page;
  const source = `stick ${side}`;
  const knob = svg('circle', { class: 'knob', cx: 50, cy: 50, r: 22 });
  const face = svg('svg', { viewBox: '0 0 100 100', 'aria-hidden': 'true' }, svg('circle', { class: 'base', cx: 50, cy: 50, r: 49 }), svg('path', { d: ARROWS }), knob);
  const stick = h('div', { class: `stick ${side}`, role: 'img', 'aria-label': t('stick') }, /** @type {any} */ (face));
  /** @type {number | null} */
  let finger = null;

  const place = (x = 0, y = 0) => {
    knob.setAttribute('transform', `translate(${WAY * x} ${-WAY * y})`);
    stick.classList.toggle('held', finger !== null);
  };
  const letGo = () => {
    if (finger === null) return;
    finger = null;
    place();
    helm.release(source);
  };
  /** The distances from the middle, to the right and ahead. @param {PointerEvent} event */
  const wayOf = ({ clientX, clientY }) => {
    const { left, top, width, height } = stick.getBoundingClientRect();
    const radius = Math.min(width, height) / 2;
    return [(clientX - left - width / 2) / radius, (top + height / 2 - clientY) / radius];
  };
  const push = (/** @type {PointerEvent} */ event) => {
    if (event.pointerId !== finger) return;
    const [x, y] = wayOf(event);
    const far = Math.hypot(x, y);
    if (far > OFF || hasLetGo(event) || !helm.holds.has(source)) {
      letGo();
      return;
    }
    place(x / Math.max(1, far), y / Math.max(1, far));
    helm.steer(source, fromStick(x, y, helm.reach));
  };

  stick.addEventListener('pointerdown', (event) => {
    const isMine = event.pointerType !== 'mouse' || event.button === 0;
    if (finger !== null || !isMine || Math.hypot(...wayOf(event)) > NEAR) return;
    event.preventDefault();
    stick.setPointerCapture(event.pointerId);
    if (page.preferences.vibrate) navigator.vibrate?.(12);
    finger = event.pointerId;
    helm.grasp(source);
    push(event);
  });
  stick.addEventListener('pointermove', push);
  for (const type of /** @type {const} */ (['pointerup', 'pointercancel', 'lostpointercapture'])) {
    stick.addEventListener(type, (event) => event.pointerId === finger && letGo());
  }
  helm.addEventListener('freed', letGo);
  addEventListener('resize', letGo);
  return stick;
}
