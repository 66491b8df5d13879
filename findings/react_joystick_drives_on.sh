#!/usr/bin/env bash
# react-joystick-component 6.2.1, joystick-controller 1.1.1 (npm): a touch that the phone cancels is never released,
# and a throttled joystick misses the last position of a quick finger.
#
# Guess before running: if the phone itself ends a touch (pointercancel or touchcancel, for example because of a call,
# a system gesture, or one finger too many), both joysticks return to the middle and report it. With `throttle={100}`
# the position at which the finger rests is finally reported.
# Outcome: wrong. Both joysticks listen only for the regular end of a touch. After a cancelled touch `stop` is not
# called, and the position does not return to 0 until somebody touches the joystick again, so a robot drives on at
# full speed. With a throttle, positions that arrive within 100 ms are dropped, even the last one. After a flick
# forward and back to the middle, the page still has full speed while the finger rests in the middle.
#
# Our page handles the three kinds of an end (pointerup, pointercancel, lostpointercapture) in the same way, and our
# robots stop if no order arrives.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-audit --no-fund react-joystick-component@6.2.1 react@18.3.1 react-dom@18.3.1 \
  joystick-controller@1.1.1 jsdom@29.1.1
cat > touch.mjs <<'JS'
import { JSDOM } from 'jsdom';
import { setTimeout as sleep } from 'node:timers/promises';

const { window } = new JSDOM('<div id="root"></div><div id="other"></div>', { pretendToBeVisual: true });
Object.assign(globalThis, { window, document: window.document });
for (const name of ['HTMLElement', 'Node', 'requestAnimationFrame', 'cancelAnimationFrame', 'navigator']) {
  Object.defineProperty(globalThis, name, { value: window[name], configurable: true });
}
Object.assign(window.HTMLElement.prototype, {
  setPointerCapture() {},
  getBoundingClientRect: () => ({ left: 0, top: 0, right: 100, bottom: 100, width: 100, height: 100 }),
});
const touchEnds = ['touchcancel', 'pointercancel', 'lostpointercapture'];
const found = {};

const { createElement } = await import('react');
const { createRoot } = await import('react-dom/client');
const { Joystick } = await import('react-joystick-component');
async function react(throttle, rest, kinds) {
  const place = document.createElement('div');
  document.body.append(place);
  let last = null;
  const tell = ({ type, y }) => (last = type === 'stop' ? 'stop' : y);
  createRoot(place).render(createElement(Joystick, { size: 100, throttle, move: tell, stop: tell }));
  await sleep(200);
  const stick = place.querySelector('button');
  const finger = (kind, target, clientY) =>
    target.dispatchEvent(new window.PointerEvent(kind, { bubbles: true, clientX: 50, clientY, pointerId: 1 }));
  finger('pointerdown', stick, 50);
  await sleep(200);
  finger('pointermove', window, 0);
  await sleep(20);
  finger('pointermove', window, rest);
  await sleep(300);
  for (const kind of kinds) finger(kind, stick, rest);
  await sleep(200);
  return last;
}
found['throttle, back in the middle'] = await react(100, 50, []);
found['no throttle, back in the middle'] = await react(0, 50, []);
found['react, lifted'] = await react(0, 0, ['pointerup']);
found['react, cancelled'] = await react(0, 0, touchEnds);

const { default: { default: JoystickController } } = await import('joystick-controller');
async function controller(kinds) {
  let last = null;
  const pad = new JoystickController({ maxRange: 100 }, ({ y }) => (last = y));
  await sleep(50);
  const touch = { identifier: 1, clientX: 50, clientY: -50 };
  const finger = (kind) => {
    const touches = Object.assign([touch], { item: () => touch });
    pad.joystick.dispatchEvent(
      Object.assign(new window.Event(kind, { bubbles: true }), { touches, changedTouches: touches }),
    );
  };
  ['touchstart', 'touchmove', ...kinds].forEach(finger);
  await sleep(50);
  return last;
}
found['controller, lifted'] = await controller(['touchend']);
found['controller, cancelled'] = await controller(touchEnds);
console.log(JSON.stringify(found, null, 1));
const expected = [1, 0, 'stop', 1, 0, 100];
process.exit(JSON.stringify(Object.values(found)) === JSON.stringify(expected) ? 0 : 1);
JS
node touch.mjs
