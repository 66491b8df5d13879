// Keeps the page's own files, so that it opens without the robot and says so. What the robot
// serves is always asked of the robot first: an update is never hidden by an old copy.

const SHELL = 'shell';

self.addEventListener('install', (event) => {
  event.waitUntil(caches.open(SHELL).then((cache) => cache.add('/')));
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

async function fromRobot(request) {
  const cache = await caches.open(SHELL);
  try {
    const answer = await fetch(request);
    if (answer.ok) await cache.put(request, answer.clone());
    return answer;
  } catch (error) {
    const kept = await cache.match(request, { ignoreSearch: true });
    if (kept) return kept;
    throw error;
  }
}
