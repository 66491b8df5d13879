// Asking the robot over HTTP. What it refuses comes with a sentence for the person.
//
// Every address is relative to the document: a proxy may serve the robot under a path.

/** What the addresses of websockets begin with, such as wss://home.example/robot. */
export const socketBase = () => new URL('.', document.baseURI).href.replace(/^http/, 'ws').slice(0, -1);

export class Refused extends Error {
  /** @param {number} status @param {string} sentence */
  constructor(status, sentence) {
    super(sentence);
    this.status = status;
  }
}

/**
 * @param {string} method
 * @param {string} path
 * @param {unknown} [body]  sent as JSON, or as it is if it is a Blob
 * @param {AbortSignal} [signal]
 * @returns {Promise<any>}
 */
export async function ask(method, path, body, signal) {
  const isFile = body instanceof Blob;
  const answer = await fetch(path, {
    method,
    signal,
    headers: body === undefined || isFile ? {} : { 'content-type': 'application/json' },
    body: body === undefined || isFile ? /** @type {Blob | undefined} */ (body) : JSON.stringify(body),
  });
  const said = await answer.json().catch(() => ({}));
  if (answer.ok) return said;
  const detail = typeof said.detail === 'string' ? said.detail : `${answer.status} ${answer.statusText}`;
  throw new Refused(answer.status, detail);
}
