// Starts the page: makes its parts and connects them to each other.

import { NOT_KEPT, WHY_MS, ask, askWhy, socketBase } from './api.js';
import './components/index.js';
import { Connection } from './connection.js';
import './extensions.js';
import { Preferences, WakeLock } from './device.js';
import { HEARTBEAT_MS } from './helm.js';
import { loadLanguage } from './i18n.js';
import { listenForStop } from './inputs/stop-keys.js';
import { Page } from './page.js';
import { parts } from './parts.js';
import { Router, fetchScreenWords } from './router.js';
import { Store } from './store.js';
import { WayFinder } from './way.js';

const MAP_MS = 1000;
const AGAIN_MS = 1000;
/** What web/index.html shows until the page has started. */
const { first } = /** @type {any} */ (globalThis);

/** Load a part of the page, and try again until it works; meanwhile, the page says so. @param {() => Promise<unknown>} act */
async function persist(act) {
  for (;;) {
    try {
      return await act();
    } catch {
      first?.tell('again');
      await new Promise((done) => setTimeout(done, AGAIN_MS));
    }
  }
}

async function start() {
  await persist(() => loadLanguage(parts.flatMap(({ words }) => words ?? [])));
  const store = new Store({
    hasKeys: matchMedia('(hover: hover) and (pointer: fine)').matches,
    isLocal: /^(localhost|127\..*|\[::1\])$/.test(location.hostname),
  });
  const connection = new Connection(socketBase());
  const page = new Page({ store, connection, preferences: new Preferences(), wakeLock: new WakeLock() });
  setInterval(() => page.helm.beatIfDue(performance.now()), HEARTBEAT_MS / 2);
  for (const name of ['app-bar', 'video-view', 'teach-panel', 'mode-bar', 'drive-pad', 'toast-bar']) {
    /** @type {any} */ (document.querySelector(name)).start(page);
  }
  addEventListener(NOT_KEPT, () => page.tellNotKept());
  new Router(page).start();
  listenForStop({ stop: () => page.stop(), isDriving: () => page.isDriving(), mayMove: () => page.helm.mayBeMoving });
  // On a computer, the page waits for the keyboard's code.
  // Few phones have a keyboard, so a phone loads this code after the first picture.
  if (store.state.hasKeys) await persist(() => listen(page));
  const way = new WayFinder({
    askState: () => ask('GET', 'api/state', undefined, WHY_MS),
    isOnline: () => store.state.isLocal || navigator.onLine !== false, // a page on the computer of the robot needs no network
    nowMs: () => performance.now(),
    tell: (found) => store.set({ way: found }),
  });
  connection.addEventListener('open', () => way.opened());
  connection.addEventListener('lost', () => way.lost());
  connection.addEventListener('lost', () => askWhy('api/state'));
  setInterval(() => way.again(), AGAIN_MS);
  for (const part of parts) part.start?.(page);
  first?.up();
  connection.begin(/** @type {any} */ (document.querySelector('video-view')).ready);
  // Load the map only for a robot that knows its pose, which its first state with a picture shows.
  store.watch(['robot'], ({ robot }) => {
    if (robot) document.body.classList.toggle('mapless', robot.frame !== null && !robot.pose);
  });
  // After the first picture, load everything that was not needed for it.
  const unwatch = store.watch(['frame'], ({ frame }) => {
    if (frame === null) return;
    unwatch();
    setTimeout(() => addTheRest(page), MAP_MS);
  });
}

/** Let keys and game pads drive. @param {Page} page */
async function listen(page) {
  const { listenToKeyboard } = await import('./inputs/keyboard.js');
  const { listenToGamepads } = await import('./inputs/gamepad.js');
  const { padDesk } = await import('./inputs/pad-desk.js');
  await fetchScreenWords(); // contains the sentences about game pads
  const reach = { stop: () => page.stop(), isDriving: () => page.isDriving() };
  listenToKeyboard(page.helm, reach);
  listenToGamepads(page.helm, { ...reach, desk: padDesk(page) });
}

/** @param {Page} page */
async function addTheRest(page) {
  if (!page.store.state.hasKeys) await persist(() => listen(page));
  await persist(() => Promise.all([import('./components/drive-map.js'), fetchScreenWords()]));
  /** @type {any} */ (document.querySelector('drive-map')).start(page);
  for (const part of parts) part.startLater?.(page);
  try {
    // If the service worker cannot be installed, the page cannot open while the robot is away; all else works.
    if (isSecureContext) await navigator.serviceWorker?.register('sw.js');
  } catch {}
}

start().catch((error) => {
  first?.fail();
  throw error;
});
