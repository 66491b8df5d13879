// Shows the current session on the page by setting `lead` in the page's state (web/js/store.js).

import { ask, inOrder } from '../api.js';

const EVERY_MS = 1000;

/**
 * A session; a pilot gets further fields (docs/reference/http.md).
 * @typedef {{step: string, position: number, of: number, kind: string | null, mode: string | null, left_s: number}} Session
 */

/** @param {Session | null} session @returns {import('../store.js').Lead | null} */
export function leadOf(session) {
  if (!session) return null;
  const { step, kind, mode, left_s, position: n, of } = session;
  const isOver = step === 'questions';
  return {
    isOver,
    ask: (robot) => {
      if (isOver) return { key: 'session.questions', step: '#study', level: 'info' };
      return !mode || robot.mode === mode ? null : { key: `session.next_${kind}`, level: 'info' };
    },
    told: mode ? { key: `session.now_${kind}`, left_s, n, of } : null,
    own: session,
  };
}

const newest = inOrder();
/** @type {ReturnType<typeof setTimeout> | undefined} */
let timer;

/** @type {() => Promise<void>} */
let speak = async () => {};

/** @param {import('../page.js').Page} page @param {() => Promise<void>} speakOf  loads the sentences about a session */
export function followSession(page, speakOf) {
  speak = speakOf;
  page.connection.addEventListener('words', (event) => {
    const { type, name } = /** @type {CustomEvent} */ (event).detail;
    if (type === 'hello' || (type === 'event' && name === 'session')) refreshSession(page);
  });
}

/** Load the session, and load it again every second while a phase is driven. @param {import('../page.js').Page} page */
export async function refreshSession(page) {
  clearTimeout(timer);
  const session = await learnSession(page, ask('GET', 'api/session'));
  if (session?.mode) timer = setTimeout(() => refreshSession(page), EVERY_MS);
}

/** Show the state of the session. @param {import('../page.js').Page} page @param {Promise<any>} question  a request whose answer contains the state */
export async function learnSession(page, question) {
  const answer = await newest(question);
  if (answer?.session && !page.store.state.lead) await speak().catch(() => {}); // if the sentences cannot be loaded, the next answer tries again
  if (answer) page.store.set({ lead: leadOf(answer.session) });
  return page.store.state.lead?.own;
}
