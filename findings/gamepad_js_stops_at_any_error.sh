#!/usr/bin/env bash
# gamepad.js 3.0.1 (npm): an error anywhere on the page stops the reading of the game controllers.
#
# Guess before running: if another script on the page throws an error, for example in the callback of a picture, the
# listener continues and reports that a stick was released.
# Outcome: wrong. Each "error" event of the window calls the library's stop(), which neither the README nor an event
# mentions. The stick's last value remains -1. The page is never told that the stick was released, or that the
# controller was unplugged, unless it calls start() again. A robot that keeps its speed until it gets a new one
# therefore drives on.
#
# Our page reads the controllers in its own loop, which does not listen for errors.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-audit --no-fund gamepad.js@3.0.1 jsdom@29.1.1
cat > stick.mjs <<'JS'
import { setTimeout as sleep } from 'node:timers/promises';
import { JSDOM, VirtualConsole } from 'jsdom';

const page = { pretendToBeVisual: true, runScripts: 'outside-only', virtualConsole: new VirtualConsole() };
const { window } = new JSDOM('', page);
const pad = { id: 'pad', index: 0, connected: true, mapping: 'standard', axes: [0, 0], buttons: [] };
let pads = [pad, null, null, null];
window.navigator.getGamepads = () => pads;
Object.assign(globalThis, { window, document: window.document });
for (const name of ['navigator', 'requestAnimationFrame', 'cancelAnimationFrame', 'CustomEvent']) {
  Object.defineProperty(globalThis, name, { value: window[name], configurable: true });
}
const { GamepadListener } = await import('gamepad.js');

async function told(isFaulty) {
  pads = [pad, null, null, null];
  pad.axes[1] = 0;
  const seen = [];
  const listener = new GamepadListener();
  listener.on('gamepad:axis', ({ detail }) => seen.push(detail.value));
  listener.on('gamepad:disconnected', () => seen.push('unplugged'));
  listener.start();
  await sleep(100);
  pad.axes[1] = -1;
  await sleep(100);
  if (isFaulty) window.eval("setTimeout(() => { throw new Error('the picture could not be drawn'); })");
  await sleep(100);
  pad.axes[1] = 0;
  await sleep(100);
  pads = [null, null, null, null];
  await sleep(100);
  listener.stop();
  return seen;
}
const found = JSON.stringify([await told(false), await told(true)]);
console.log('without, with an error of another script:', found);
process.exit(found === '[[-1,0,"unplugged"],[-1]]' ? 0 : 1);
JS
node stick.mjs
