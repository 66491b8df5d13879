// Redeems the one-time token behind the # of the address, or one typed by hand, for a cookie.
// What stands behind the # is never sent to a server or written into a log. This page speaks for
// itself: an unpaired browser gets nothing else of the program, and its words come inside it.

/** How long a sentence stands before the page behind it opens. */
const READ_MS = 6000;

/** @type {Record<string, Record<string, string>>} in each language; put in by the server */
const WORDS = {/* pair. */};

const form = /** @type {HTMLFormElement} */ (document.querySelector('#pair'));
const field = /** @type {HTMLInputElement} */ (document.querySelector('#token'));
const said = /** @type {HTMLElement} */ (document.querySelector('#said'));

const language = navigator.languages.map((tag) => tag.toLowerCase().split('-')[0]).find((code) => code in WORDS) ?? 'en';
const words = { ...WORDS.en, ...WORDS[language] };
document.documentElement.lang = language;
for (const element of document.querySelectorAll('[data-say]')) {
  const key = element.getAttribute('data-say') ?? '';
  if (words[key]) element.textContent = words[key];
}

/** @param {string} token */
async function redeem(token) {
  said.textContent = words.wait;
  try {
    const answer = await fetch('api/pair', {
      method: 'POST',
      headers: { 'content-type': 'application/json' },
      body: JSON.stringify({ token }),
      signal: AbortSignal.timeout(10_000),
    });
    if (answer.ok) {
      const { role, kept } = await answer.json();
      if (kept === false) {
        said.textContent = words.not_kept;
        await new Promise((read) => setTimeout(read, READ_MS));
      }
      location.replace(role === 'eye' ? 'eye' : './');
      return;
    }
    said.textContent = answer.status === 429 ? words.later : words.wrong;
  } catch {
    said.textContent = words.away;
  }
  field.focus();
}

form.addEventListener('submit', (event) => {
  event.preventDefault();
  redeem(field.value);
});

/** A new token behind the # of an address that is open already loads no page. */
function redeemAddress() {
  const token = location.hash.slice(1);
  if (!token) return;
  history.replaceState(null, '', location.pathname);
  redeem(token);
}

addEventListener('hashchange', redeemAddress);
redeemAddress();
