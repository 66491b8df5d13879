// HTTP requests to the robot. If the robot refuses a request, its answer contains a sentence for the person.
//
// Every address is relative to the document: a proxy may serve the robot under a path.

/** The start of the websockets' addresses, for example wss://home.example/robot. */
export const socketBase = () => new URL('.', document.baseURI).href.replace(/^http/, 'ws').slice(0, -1);

export class Refused extends Error {
  /** @param {number} status @param {string} sentence @param {'refuses' | 'starts' | null} robot */
  constructor(status, sentence, robot) {
    super(sentence);
    this.status = status;
    /** The robot's status; null if something else answered instead of the robot. */
    this.robot = robot;
  }
}

/** Timeout of an answer: a server that accepts a request and never answers counts as out of reach. */
const ANSWER_MS = 15_000;
/** Timeout of slow requests, which carry a file, read or rewrite a recording, or let a small computer measure itself. */
export const LONG_MS = 180_000;
/** Timeout of a STOP by an HTTP request. A request that arrived later could stop the robot again after a release. */
export const STOPPING_MS = 3000;
/** Time that a websocket has to confirm a STOP before HTTP requests are sent, and the pause after a failed request. */
export const STOP_MS = 300;

/** Event of the window that reports that the robot has carried out a request but could not save the result. */
export const NOT_KEPT = 'not-kept';

/**
 * Send a request. Throws Refused if the robot refuses, and TypeError if there is no complete answer.
 * @param {string} method
 * @param {string} path
 * @param {unknown} [body]  a Blob is sent unchanged, anything else as JSON
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
      redirect: 'manual', // the robot never redirects, so a redirection comes from the sign-in page of a network
      headers: body === undefined || isFile ? {} : { 'content-type': 'application/json' },
      body: body === undefined || isFile ? /** @type {Blob | undefined} */ (body) : JSON.stringify(body),
    });
    const isPage = answer.type === 'opaqueredirect' || (answer.ok && /^text\/html/.test(answer.headers?.get('content-type') ?? ''));
    if (isPage) throw new Refused(answer.status, `${answer.status} text/html`, null);
    if (answer.ok) {
      const told = await answer.json();
      // report the failed save after the screen's own message, so that the person reads both
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
 * Stop the robot by requests, one after the other. The requests end when the robot confirms one, when it refuses one because the page is not admitted, or when the stop is no longer needed or is requested again.
 * @param {() => boolean} isOwed
 * @returns {Promise<number | null>} the number of the STOP; null if the robot did not confirm it
 */
export async function askToStop(isOwed) {
  const own = (stopsAsked += 1);
  while (own === stopsAsked && isOwed()) {
    try {
      return (await ask('POST', 'api/stop', undefined, STOPPING_MS)).stop_number;
    } catch (refused) {
      if (/** @type {any} */ (refused).status < 500) return null;
      await new Promise((again) => setTimeout(again, STOP_MS));
    }
  }
  return null;
}

/** Timeout of requests that ask why the link is lost. The timeout is short, so that a STOP by HTTP does not wait long behind such a request. */
export const WHY_MS = 2000;

/** Ask by an HTTP request why a websocket was refused, because the websocket itself gives no reason. A page that is no longer admitted is loaded again. @param {string} path  a path that an admitted browser may request */
export const askWhy = (path) => ask('GET', path, undefined, WHY_MS).catch(({ status, robot }) => status === 401 && robot && location.reload());

/** Send a request with a long timeout. @param {string} path */
export const askLong = (path) => ask('GET', path, undefined, LONG_MS);

/**
 * Wrap repeated requests: return the answer, or null if there was no answer, or if a newer request was answered earlier.
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
