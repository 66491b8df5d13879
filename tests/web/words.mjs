// All sentences of the page and its extensions, by language.
import { existsSync, readdirSync } from 'node:fs';

const web = new URL('../../web/', import.meta.url);
const folders = (below) => readdirSync(new URL(below, web), { withFileTypes: true }).flatMap((entry) => {
  if (!entry.isDirectory()) return [];
  return entry.name === 'messages' ? [`${below}messages/`] : folders(`${below}${entry.name}/`);
});
/** The folders with sentences; the core's folder is the first. */
export const FOLDERS = ['js/messages/', ...folders('').filter((folder) => folder !== 'js/messages/')];

/** @param {string} code @returns {Promise<Record<string, string>[]>} by folder */
export const wordsByFolder = (code) => Promise.all(FOLDERS.map(async (folder) => {
  const file = new URL(`${folder}${code}.js`, web);
  return existsSync(file) ? (await import(file)).default : {};
}));

/** @param {string} code @returns {Promise<Record<string, string>>} */
export const wordsOf = async (code) => Object.assign({}, ...(await wordsByFolder(code)));
