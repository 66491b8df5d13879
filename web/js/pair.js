// Redeems the one-time token behind the # of the address, or one typed by hand, for a cookie.
// What stands behind the # is never sent to a server or written into a log. This page speaks for
// itself: an unpaired browser gets nothing else of the program.

const WORDS = {
  en: {
    title: 'Let this browser in', ask: 'Type the token that the robot’s terminal shows.', token: 'Token', pair: 'Pair',
    wait: 'One moment …', wrong: 'This token is wrong, or was used already. The terminal shows the newest.',
    later: 'Too many wrong tokens. Wait a minute, then try again.',
    away: 'The robot does not answer. Is the phone on the same network?',
  },
  es: {
    title: 'Dar acceso a este navegador', ask: 'Escribe el código que muestra el terminal del robot.', token: 'Código', pair: 'Vincular',
    wait: 'Un momento…', wrong: 'Este código no es correcto o ya se usó. El terminal muestra el más nuevo.',
    later: 'Demasiados códigos erróneos. Espera un minuto y vuelve a intentarlo.',
    away: 'El robot no responde. ¿Está el teléfono en la misma red?',
  },
  zh: {
    title: '允许此浏览器进入', ask: '请输入机器人终端上显示的配对码。', token: '配对码', pair: '配对',
    wait: '请稍候……', wrong: '配对码不正确或已被使用。终端上显示的是最新的配对码。',
    later: '错误次数过多。请等一分钟后再试。',
    away: '机器人没有回应。手机是否在同一网络中？',
  },
};

const form = /** @type {HTMLFormElement} */ (document.querySelector('#pair'));
const field = /** @type {HTMLInputElement} */ (document.querySelector('#token'));
const said = /** @type {HTMLElement} */ (document.querySelector('#said'));

const language = navigator.languages.map((tag) => tag.toLowerCase().split('-')[0]).find((code) => code in WORDS) ?? 'en';
const words = WORDS[/** @type {keyof typeof WORDS} */ (language)];
document.documentElement.lang = language;
for (const element of document.querySelectorAll('[data-say]')) {
  element.textContent = words[/** @type {keyof typeof words} */ (element.getAttribute('data-say'))];
}

/** @param {string} token */
async function redeem(token) {
  said.textContent = words.wait;
  try {
    const answer = await fetch('/api/pair', {
      method: 'POST',
      headers: { 'content-type': 'application/json' },
      body: JSON.stringify({ token }),
    });
    if (answer.ok) {
      location.replace((await answer.json()).role === 'eye' ? '/eye' : '/');
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

const token = location.hash.slice(1);
if (token) {
  history.replaceState(null, '', location.pathname);
  redeem(token);
}
