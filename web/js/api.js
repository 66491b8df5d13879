// Asking the robot over HTTP. What it refuses comes with a sentence for the person.
//
// Every address is relative to the document: a proxy may serve the robot under a path.

/** What the addresses of websockets begin with, such as wss://home.example/robot. */
export const socketBase = () => new URL('.', document.baseURI).href.replace(/^http/, 'ws').slice(0, -1);

export class Refused extends Error {
  /** @param {number} status @param {string} sentence @param {'refuses' | 'starts' | null} robot */
  constructor(status, sentence, robot) {
    super(sentence);
    this.status = status;
    /** What the robot itself says; null if something else answers in its place. */
    this.robot = robot;
  }
}

/** How long an answer is waited for: a server that takes a request and never answers is out of reach. */
const ANSWER_MS = 15_000;
/** What carries a file, reads or rewrites a recording, or has a small computer measure itself takes its time. */
export const LONG_MS = 180_000;
/** A stop by request is so long under way at most: it could latch the stop again that is released meanwhile. */
export const STOPPING_MS = 3000;
/** How long a websocket has to show a stop, and how long after a failed request the next one follows. */
export const STOP_MS = 300;

/** Sent to the window when the robot did what it was asked, but could not write it to its disk. */
export const NOT_KEPT = 'not-kept';

/**
 * Refused if the robot says no; TypeError if no answer came, or only a part of one.
 * @param {string} method
 * @param {string} path
 * @param {unknown} [body]  sent as JSON, or as it is if it is a Blob
 * @param {number} [patienceMs]
 * @returns {Promise<any>}
 */
export async function ask(method, path, body, patienceMs = method === 'GET' ? ANSWER_MS : LONG_MS) {
  const isFile = body instanceof Blob;
  const patience = new AbortController();
  const timer = setTimeout(() => patience.abort(), patienceMs);
  try {
    const answer = await fetch(path, {
      method,
      signal: patience.signal,
      redirect: 'manual', // the robot has none: it is a network's sign-in page, elsewhere
      headers: body === undefined || isFile ? {} : { 'content-type': 'application/json' },
      body: body === undefined || isFile ? /** @type {Blob | undefined} */ (body) : JSON.stringify(body),
    });
    const isPage = answer.type === 'opaqueredirect' || (answer.ok && /^text\/html/.test(answer.headers?.get('content-type') ?? ''));
    if (isPage) throw new Refused(answer.status, `${answer.status} text/html`, null);
    if (answer.ok) {
      const told = await answer.json();
      // After whatever the screen says of it: the person must read both.
      if (told?.kept === false) setTimeout(() => dispatchEvent(new Event(NOT_KEPT)));
      return told;
    }
    const { detail } = await answer.json().catch(() => ({}));
    const isRobots = typeof detail === 'string';
    const robot = answer.headers?.get('x-drivelesson') === 'starting' ? 'starts' : isRobots ? 'refuses' : null;
    throw new Refused(answer.status, isRobots ? detail : `${answer.status} ${answer.statusText}`, robot);
  } catch (error) {
    throw error instanceof Refused ? error : new TypeError(String(error));
  } finally {
    clearTimeout(timer);
  }
}

let stopsAsked = 0;
/**
 * Stop the robot by requests, one after the other, until it hears one, refuses (a page that is not admitted), the stop is owed no more, or is asked for anew.
 * @param {() => boolean} isOwed
 * @returns {Promise<boolean>} whether the robot heard it
 */
export async function askToStop(isOwed) {
  const own = (stopsAsked += 1);
  while (own === stopsAsked && isOwed()) {
    try {
      await ask('POST', 'api/stop', undefined, STOPPING_MS);
      return true;
    } catch (refused) {
      if (/** @type {any} */ (refused).status < 500) return false;
      await new Promise((again) => setTimeout(again, STOP_MS));
    }
  }
  return false;
}

/** How long a lost link is asked why: no STOP by request waits behind these questions. */
export const WHY_MS = 2000;

/** A websocket that is refused does not say why: a browser that is admitted no longer is led elsewhere by the document's own address. @param {string} path  what an admitted browser gets */
export const askWhy = (path) => ask('GET', path, undefined, WHY_MS).catch(({ status, robot }) => status === 401 && robot && location.reload());

/** A question that is no quick one. @param {string} path */
export const askLong = (path) => ask('GET', path, undefined, LONG_MS);

/**
 * For what is asked again and again: passes on an answer, but null for one that comes after the answer to a
 * newer question, and where none came. What is known by now is newer than that.
 */
export function inOrder() {
  let [asked, answered] = [0, 0];
  return async (/** @type {Promise<any>} */ question) => {
    const own = (asked += 1);
    const answer = (await question.catch(() => null)) ?? null;
    if (answer === null || own < answered) return null;
    answered = own;
    return answer;
  };
}
