// Exchanges the one-time token after the # of the address, or a typed token, for a cookie.
// Browsers send the part after the # to no server, so it appears in no log.
// This page contains its own sentences, because an unpaired browser gets no other file of the program.

/** The page shows a sentence this long before it opens the robot's page. */
const READ_MS = 6000;

/** @type {Record<string, Record<string, string>>} in each language */
const WORDS = {
  en: {
    title: 'Pair this browser with the robot',
    ask: 'Type the token from the robot’s terminal, or from the robot’s card.',
    token: 'Token',
    pair: 'Pair',
    wait: 'One moment …',
    wrong: 'This token is wrong or already used. The terminal shows the newest token.',
    not_kept: 'Paired, but the robot could not save this: after a restart of the robot, pair again.',
    later: 'Too many wrong tokens. Wait a minute, then try again.',
    away: 'The robot does not answer. Is this device on the robot’s network?',
  },
  es: {
    title: 'Vincular este navegador con el robot',
    ask: 'Escribe el código que muestra el terminal del robot o su tarjeta.',
    token: 'Código',
    pair: 'Vincular',
    wait: 'Un momento…',
    wrong: 'Este código es incorrecto o ya se ha usado. El terminal muestra el más reciente.',
    not_kept: 'Vinculado, pero el robot no pudo guardarlo: si el robot se reinicia, vincúlalo de nuevo.',
    later: 'Demasiados códigos erróneos. Espera un minuto y vuelve a intentarlo.',
    away: 'El robot no responde. ¿Está este dispositivo en la red del robot?',
  },
  zh: {
    title: '将此浏览器与机器人配对',
    ask: '请输入机器人终端上或卡片上的配对码。',
    token: '配对码',
    pair: '配对',
    wait: '请稍候……',
    wrong: '配对码不正确或已被使用。终端上显示的是最新的配对码。',
    not_kept: '已配对，但机器人的磁盘无法写入：机器人重启后请重新配对。',
    later: '错误次数过多。请等一分钟后再试。',
    away: '机器人没有回应。此设备是否在机器人的网络中？',
  },
};

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

/** Also called when the # of the open address gets another token, because browsers then do not load the page again. */
function redeemAddress() {
  const token = location.hash.slice(1);
  if (!token) return;
  history.replaceState(null, '', location.pathname);
  redeem(token);
}

addEventListener('hashchange', redeemAddress);
redeemAddress();
