// The page's texts in the user's language, from plain message files; missing texts are in English.

import { memory } from './device.js';

export const LANGUAGES = { en: 'English', es: 'Español', zh: '中文' };
const KEY = 'drivelesson.language';

/** @type {Record<string, string>} */
let messages = {};
/** @param {readonly string[]} wanted  as in `navigator.languages` @param {string | null} chosen */
export function pickLanguage(wanted, chosen) {
  const codes = [chosen ?? '', ...wanted].map((tag) => tag.toLowerCase().split('-')[0]);
  return codes.find((code) => code in LANGUAGES) ?? 'en';
}

export const language = pickLanguage(globalThis.navigator?.languages ?? [], memory.getItem(KEY));

/** @typedef {(code: string) => Promise<{default: Record<string, string>}>} Load  a message file */

/**
 * Load the language. A sentence or an extension that lacks the language is shown in English. In a joined page, each
 * language's file is complete, so that English is not loaded too.
 * @param {Load[]} [more]  of extensions @param {Load} [load]
 */
export async function loadLanguage(more = [], load = (code) => import(`./messages/${code}.js`)) {
  const codes = language === 'en' || 'joined' in globalThis ? [language] : ['en', language];
  const files = codes.flatMap((code) => [load(code), ...more.map((each) => each(code).catch(() => ({ default: {} })))]);
  messages = Object.assign({}, ...(await Promise.all(files)).map((file) => file.default));
  document.documentElement.lang = language;
}

/** Add an extension's further sentences, in English if it lacks the language. @param {Load} load */
export async function fetchWords(load) {
  learn((await load(language).catch(() => load('en'))).default);
}

/** Add texts of the robot's driver. @param {Record<string, string>} words */
export function learn(words) {
  messages = { ...messages, ...words };
}

/** Return the text of a move; without a text, the move is shown by its name. @param {string} key */
function nameOf(key) {
  const name = key.match(/^moves?\.(\w+)$/)?.[1].replace(/_/g, ' ') ?? key;
  return name === key ? key : name[0].toUpperCase() + name.slice(1);
}

/** Set a language without loading it, for tests and tools. @param {Record<string, string>} words */
export function speak(words) {
  messages = words;
}

/** @param {string} code */
export function chooseLanguage(code) {
  memory.setItem(KEY, code);
  location.reload();
}

/**
 * The sentence called `key`, with `{name}` filled in.
 * @param {string} key
 * @param {Record<string, string | number>} [values]
 */
export function t(key, values = {}) {
  const text = messages[key] ?? nameOf(key);
  return text.replace(/\{(\w+)\}/g, (whole, name) => String(values[name] ?? whole));
}

/** True if the language has a sentence for the key. @param {string} key */
export const has = (key) => key in messages;

/** @param {number} value */
export const count = (value) => value.toLocaleString(language);

/** @param {number} share */
export const percent = (share) => `${Math.round(share * 100)} %`;
