#!/usr/bin/env bash
# joypad.js 2.3.5 (npm): the middle of a game controller's stick is never reported.
#
# Guess before running: when a stick springs back, `axis_move` is sent once more with a value near 0, or there is
# another event, like `button_release` for a button.
# Outcome: wrong. `axis_move` is the only event. It is sent with each frame of the screen while the stick is more than
# 0.3 off its middle. If a stick is released at full speed, the last value that a page gets is -1, so a robot that
# uses each event's value never stops. The page must interpret silence as the middle, or read joypad.instances itself.
#
# Our page polls the controllers itself, and compares each reading with the previous one.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-audit --no-fund joypad.js@2.3.5 jsdom@29.1.1
cat > stick.mjs <<'JS'
import { readFileSync } from 'node:fs';
import { setTimeout as sleep } from 'node:timers/promises';
import { JSDOM } from 'jsdom';

const { window } = new JSDOM('', { pretendToBeVisual: true, runScripts: 'outside-only' });
const pad = { id: 'pad', index: 0, connected: true, mapping: 'standard', axes: [0, 0, 0, 0], buttons: [] };
for (let i = 0; i < 17; i++) pad.buttons.push({ pressed: false, touched: false, value: 0 });
window.navigator.getGamepads = () => [pad, null, null, null];
window.eval(readFileSync('node_modules/joypad.js/dist/joypad.min.js', 'utf8'));

const told = [];
window.joypad.on('axis_move', ({ detail }) => told.push(detail.axisMovementValue));
window.joypad.on('button_release', ({ detail }) => told.push(`released ${detail.buttonName}`));
window.dispatchEvent(Object.assign(new window.Event('gamepadconnected'), { gamepad: pad }));
await sleep(100);
pad.axes[1] = -1;
pad.buttons[0] = { pressed: true, touched: true, value: 1 };
await sleep(200);
pad.axes[1] = 0;
pad.buttons[0] = { pressed: false, touched: false, value: 0 };
await sleep(500);
const moves = told.filter((value) => typeof value === 'number');
console.log(`axis_move: ${moves.length} events, values ${[...new Set(moves)]}; others: ${told.slice(moves.length)}`);
process.exit(moves.length > 2 && moves.every((value) => value === -1) && told.at(-1) === 'released button_0' ? 0 : 1);
JS
node stick.mjs
