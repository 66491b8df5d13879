// Keeps the page's own files from the first visit on, so that it opens without the robot and says so.
//
// A file whose name begins with a hash never changes: it is fetched once, and a kept one is as good as
// the robot's. The document and the icons are asked of the robot first: an update is never hidden by an
// old copy. A robot that does not answer in time counts as away.

const SHELL = 'shell';
const PATIENCE_MS = 2500;
const HASHED = /^\/(css|js)\/[0-9a-f]{10}-/;

self.addEventListener('install', (event) => {
  event.waitUntil(keepAll());
  self.skipWaiting();
});

self.addEventListener('activate', (event) => event.waitUntil(self.clients.claim()));

self.addEventListener('fetch', (event) => {
  const url = new URL(event.request.url);
  if (url.origin !== location.origin || event.request.method !== 'GET') return;
  if (HASHED.test(url.pathname)) event.respondWith(keptOrFetched(event.request));
  else if (url.pathname === '/' || /^\/icons\/|\.webmanifest$/.test(url.pathname)) event.respondWith(fromRobot(event));
});

/** Fetch what is missing, and drop what no page asks for any more. */
async function keepAll() {
  const cache = await caches.open(SHELL);
  const files = await (await fetch('/shell.json')).json();
  const kept = new Set((await cache.keys()).map((request) => new URL(request.url).pathname));
  await cache.addAll(files.filter((file) => !HASHED.test(file) || !kept.has(file)));
  for (const old of kept) if (!files.includes(old) && !old.endsWith('-study.js')) await cache.delete(old);
}

async function keptOrFetched(request) {
  const cache = await caches.open(SHELL);
  const kept = await cache.match(request, { ignoreSearch: true });
  if (kept) return kept;
  const answer = await fetch(request);
  if (answer.ok) await cache.put(request, answer.clone());
  return answer;
}

async function fromRobot(event) {
  const { request } = event;
  const cache = await caches.open(SHELL);
  const kept = await cache.match(request, { ignoreSearch: true });
  const fresh = fetch(request).then(async (answer) => {
    if (!answer.ok) return answer;
    const isNew = kept && kept.headers.get('etag') !== answer.headers.get('etag');
    await cache.put(request, answer.clone());
    if (isNew && request.mode === 'navigate') event.waitUntil(keepAll().catch(() => {}));
    return answer;
  });
  if (!kept) return fresh;
  const late = new Promise((done) => setTimeout(() => done(kept), PATIENCE_MS));
  return Promise.race([fresh.catch(() => kept), late]);
}
