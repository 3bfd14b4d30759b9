/**
 * Opens a page that says so when the station cannot be reached.
 *
 * The network is asked first, always: nothing of the app and nothing that the station says is ever
 * answered from here while the station answers, so an upgraded station is seen at once. Kept are
 * the page without contact and the files that it names, and only as long as it names them.
 */

interface Extendable extends Event {
  waitUntil(work: Promise<unknown>): void;
}

interface Asked extends Extendable {
  readonly request: Request;
  respondWith(answer: Promise<Response>): void;
}

interface Worker {
  readonly clients: { claim(): Promise<void> };
  skipWaiting(): Promise<void>;
  addEventListener(kind: 'install' | 'activate', listen: (event: Extendable) => void): void;
  addEventListener(kind: 'fetch', listen: (event: Asked) => void): void;
}

const worker = self as unknown as Worker;
const STORE = 'grace.offline';
const PAGE = '/offline.html';
const PATIENCE_MS = 30_000;
let isFresh = false;

worker.addEventListener('install', (event) => {
  event.waitUntil(keepPage().then(() => worker.skipWaiting()));
});

worker.addEventListener('activate', (event) => {
  event.waitUntil(worker.clients.claim());
});

worker.addEventListener('fetch', (event) => {
  const { request } = event;
  const { origin, pathname } = new URL(request.url);
  if (request.method !== 'GET' || origin !== self.location.origin) return;
  if (request.mode === 'navigate') {
    const isPage = request.destination === 'document' && !pathname.startsWith('/api/');
    if (isPage) event.respondWith(opened(event));
  } else if (pathname.startsWith('/assets/')) {
    event.respondWith(fetch(request).catch(() => kept(request)));
  }
});

async function opened(event: Asked): Promise<Response> {
  try {
    const answer = await Promise.race([fetch(event.request), outOfPatience()]);
    if (!isFresh) event.waitUntil(refresh());
    return answer;
  } catch {
    return kept(PAGE);
  }
}

async function outOfPatience(): Promise<never> {
  await new Promise((resolve) => setTimeout(resolve, PATIENCE_MS));
  throw new Error('the station did not answer');
}

async function kept(request: Request | string): Promise<Response> {
  const store = await caches.open(STORE);
  return (await store.match(request)) ?? Response.error();
}

/** An upgraded station may have another page without contact. */
async function refresh(): Promise<void> {
  isFresh = true;
  try {
    await keepPage();
  } catch {
    isFresh = false;
  }
}

async function keepPage(): Promise<void> {
  const page = await fetch(PAGE, { cache: 'no-cache' });
  if (!page.ok) throw new Error(`${PAGE}: ${page.status}`);
  const text = await page.clone().text();
  const parts = Array.from(
    text.matchAll(/(?:src|href)="(\/assets\/[^"]+)"/g),
    ([, path]) => path ?? '',
  );
  const store = await caches.open(STORE);
  await store.addAll(parts);
  await store.put(PAGE, page);
  const wanted = new Set([PAGE, ...parts]);
  for (const { url } of await store.keys()) {
    if (!wanted.has(new URL(url).pathname)) await store.delete(url);
  }
}
