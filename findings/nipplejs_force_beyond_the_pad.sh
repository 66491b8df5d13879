#!/usr/bin/env bash
# nipplejs 1.0.4 (npm): the force of an on-screen joystick has no upper limit.
#
# Guess before running: "force", which the README calls "strength in %" with 0.2 as an example, is at most 1, which it
# reaches where the stick stops. The distance has this limit, too.
# Outcome: wrong. The stick, the distance and the vector stop at the pad's edge, but the force keeps growing with the
# finger's distance: at three times the radius it is 3. A page that multiplies its maximum speed by the force requests
# three times that speed if a finger slides that far.
#
# Our page has its own pad, whose values are at most 1.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-audit --no-fund nipplejs@1.0.4 jsdom@29.1.1
cat > slide.mjs <<'JS'
import { JSDOM } from 'jsdom';
const { window } = new JSDOM('<div id="pad" style="position: relative"></div>', { pretendToBeVisual: true });
Object.assign(globalThis, { window, document: window.document });
for (const name of ['HTMLElement', 'Node', 'MutationObserver', 'getComputedStyle', 'requestAnimationFrame']) {
  globalThis[name] = window[name];
}
const { default: nipplejs } = await import('nipplejs');
const zone = document.getElementById('pad');
const pad = nipplejs.create({ zone, mode: 'static', position: { left: '0px', top: '0px' }, size: 100 });
const found = [];
pad.on('move', (event, data = event.data) => found.push([data.force, data.distance, data.vector.x]));
function finger(kind, target, x) {
  const event = new window.Event(kind, { bubbles: true });
  Object.assign(event, { pageX: x, pageY: 0, clientX: x, clientY: 0, pointerId: 1, button: 0, buttons: 1 });
  Object.assign(event, { identifier: 1, pointerType: 'touch' });
  target.dispatchEvent(event);
}
for (const kind of ['pointer', 'mouse']) {
  finger(`${kind}down`, zone, 0);
  for (const x of [25, 50, 150]) finger(`${kind}move`, document, x);
}
const text = JSON.stringify(found.slice(-3));
console.log('[force, distance, vector.x]:', text);
process.exit(text === '[[0.5,25,0.5],[1,50,1],[3,50,1]]' ? 0 : 1);
JS
node slide.mjs
