// Keeps the page's own files, all of them from the first visit on, so that it opens without the
// robot and says so. What the robot serves is asked of the robot first: an update is never hidden
// by an old copy. A robot that does not answer in time counts as away.

const SHELL = 'shell';
const PATIENCE_MS = 2500;

self.addEventListener('install', (event) => {
  event.waitUntil(keepAll());
  self.skipWaiting();
});

self.addEventListener('activate', (event) => event.waitUntil(self.clients.claim()));

self.addEventListener('fetch', (event) => {
  const url = new URL(event.request.url);
  const isOurs = url.origin === location.origin && event.request.method === 'GET';
  if (isOurs && (url.pathname === '/' || /^\/(css|icons|js)\/|\.webmanifest$/.test(url.pathname))) {
    event.respondWith(fromRobot(event.request));
  }
});

async function keepAll() {
  const cache = await caches.open(SHELL);
  const files = await (await fetch('/shell.json')).json();
  await cache.addAll(files);
}

async function fromRobot(request) {
  const cache = await caches.open(SHELL);
  const kept = await cache.match(request, { ignoreSearch: true });
  const fresh = fetch(request).then(async (answer) => {
    if (answer.ok) await cache.put(request, answer.clone());
    return answer;
  });
  if (!kept) return fresh;
  const late = new Promise((done) => setTimeout(() => done(kept), PATIENCE_MS));
  return Promise.race([fresh.catch(() => kept), late]);
}
