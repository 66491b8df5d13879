// Caches the page's files at the first visit, so that the page can later open without the robot, and say that it is away.
//
// A file whose name begins with a hash never changes, so it is fetched only once.
// The document and the icons are requested from the robot first, so that no old copy hides an update.
// A robot that does not answer in time counts as away.

const HOME = new URL('.', location).pathname; // a proxy may serve several robots, each under its own path
const SHELL = `shell${HOME.slice(0, -1)}`;
const PATIENCE_MS = 2500;
const HASHED = /^(css|js)\/[0-9a-f]{10}-/;

/** Return the path of a file relative to the page, as in shell.json; null for an address of another site. @param {string} url */
const below = (url) => (url.startsWith(location.origin + HOME) ? new URL(url).pathname.slice(HOME.length) || './' : null);

self.addEventListener('install', (event) => {
  event.waitUntil(keepAll());
  self.skipWaiting();
});

self.addEventListener('activate', (event) => event.waitUntil(self.clients.claim()));

self.addEventListener('fetch', (event) => {
  const file = below(event.request.url);
  if (file === null || event.request.method !== 'GET') return;
  if (HASHED.test(file)) event.respondWith(keptOrFetched(event.request));
  else if (file === './' || /^icons\/|\.webmanifest$/.test(file)) event.respondWith(fromRobot(event));
});

/** Fetch the missing files, and delete the files that no page needs any more. */
async function keepAll() {
  const cache = await caches.open(SHELL);
  const files = await (await fetch('shell.json')).json();
  const kept = new Set((await cache.keys()).map((request) => below(request.url)));
  await cache.addAll(files.filter((file) => !HASHED.test(file) || !kept.has(file)));
  for (const old of kept) if (!files.includes(old)) await cache.delete(old);
}

/** Return the cached answer; undefined if there is none, or if the device's storage fails. */
async function recall(request) {
  try {
    return await (await caches.open(SHELL)).match(request, { ignoreSearch: true });
  } catch {
    return undefined;
  }
}

async function keep(request, answer) {
  try {
    await (await caches.open(SHELL)).put(request, answer);
  } catch {}
}

async function keptOrFetched(request) {
  const kept = await recall(request);
  if (kept) return kept;
  const answer = await fetch(request);
  if (answer.ok) await keep(request, answer.clone());
  return answer;
}

async function fromRobot(event) {
  const { request } = event;
  const kept = await recall(request);
  const fresh = fetch(request).then(async (answer) => {
    if (!answer.ok) return answer;
    const isNew = kept && kept.headers.get('etag') !== answer.headers.get('etag');
    // A new page is stored only together with all its parts; without them it could not open while the robot is away.
    if (isNew && request.mode === 'navigate') event.waitUntil(keepAll().catch(() => {}));
    else await keep(request, answer.clone());
    return answer;
  });
  event.waitUntil(fresh.catch(() => {})); // an answer that comes too late for this visit is stored for the next one
  if (!kept) return fresh;
  const late = new Promise((done) => setTimeout(() => done(kept), PATIENCE_MS));
  return Promise.race([fresh.catch(() => kept), late]);
}
