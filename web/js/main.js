// Wires the modules together.

import { Connection } from './connection.js';
import { Preferences, WakeLock } from './device.js';
import { HEARTBEAT_MS } from './helm.js';
import { loadLanguage } from './i18n.js';
import { listenToGamepads } from './inputs/gamepad.js';
import { listenToKeyboard } from './inputs/keyboard.js';
import { Page } from './page.js';
import { followReadiness } from './readiness.js';
import { Router } from './router.js';
import { Store } from './store.js';

const MAP_MS = 1000;

await loadLanguage();
const store = new Store({ hasKeys: matchMedia('(hover: hover) and (pointer: fine)').matches });
const connection = new Connection(`${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}`);
const page = new Page({ store, connection, preferences: new Preferences(), wakeLock: new WakeLock() });
setInterval(() => page.helm.beatIfDue(performance.now()), HEARTBEAT_MS / 2);

await import('./components/index.js');
for (const name of ['app-bar', 'video-view', 'teach-panel', 'mode-bar', 'drive-pad', 'toast-bar']) {
  /** @type {any} */ (document.querySelector(name)).start(page);
}
new Router(page).start();
followReadiness(store);
const reach = { stop: () => page.stop(), isDriving: () => page.isDriving() };
listenToKeyboard(page.helm, reach);
listenToGamepads(page.helm, reach);
await /** @type {any} */ (document.querySelector('video-view')).ready;
connection.connect();
// A robot that does not know where it is has no map. Which one that is, its first picture tells.
store.watch(['robot'], ({ robot }) => {
  if (robot) document.body.classList.toggle('mapless', robot.frame !== null && !robot.pose);
});
// The map is not needed for the first picture, and comes after it.
const unwatch = store.watch(['frame'], ({ frame }) => {
  if (frame === null) return;
  unwatch();
  setTimeout(async () => {
    await import('./components/drive-map.js');
    /** @type {any} */ (document.querySelector('drive-map')).start(page);
  }, MAP_MS);
});
if (isSecureContext && 'serviceWorker' in navigator) {
  navigator.serviceWorker.register('/sw.js').catch(() => {}); // only the shell without a robot is lost
}
