// Redeems the one-time token behind the # of the address, or one typed by hand, for a cookie.
// What stands behind the # is never sent to a server or written into a log.

const form = /** @type {HTMLFormElement} */ (document.querySelector("#pair"));
const field = /** @type {HTMLInputElement} */ (document.querySelector("#token"));
const said = /** @type {HTMLElement} */ (document.querySelector("#said"));

/** @param {string} token */
async function redeem(token) {
  said.textContent = "One moment …";
  try {
    const answer = await fetch("/api/pair", {
      method: "POST",
      headers: { "content-type": "application/json" },
      body: JSON.stringify({ token }),
    });
    if (answer.ok) {
      location.replace("/");
      return;
    }
    said.textContent = (await answer.json()).detail;
  } catch {
    said.textContent = "The robot does not answer. Is the phone on the same network?";
  }
  field.focus();
}

form.addEventListener("submit", (event) => {
  event.preventDefault();
  redeem(field.value);
});

const token = location.hash.slice(1);
if (token) {
  history.replaceState(null, "", location.pathname);
  redeem(token);
}
