import assert from 'node:assert/strict';
import { readFileSync, readdirSync } from 'node:fs';
import { test } from 'node:test';

import { LANGUAGES, pickLanguage } from '../../web/js/i18n.js';
import { FOLDERS, wordsByFolder, wordsOf as read } from './words.mjs';

const web = new URL('../../web/', import.meta.url);
const english = await read('en');
/** The languages that must be complete; others may be partly translated. */
const WHOLE = ['en', 'es', 'zh'];
const places = (sentence) => [...sentence.matchAll(/\{(\w+)\}/g)].map(([, name]) => name).sort();

test('each language in the menu has a file, and each file is in the menu', () => {
  const [core, ...others] = FOLDERS.map((folder) => readdirSync(new URL(folder, web)).map((name) => name.replace('.js', '')));
  assert.deepEqual(core.sort(), Object.keys(LANGUAGES).sort());
  // If an extension lacks a language, the page shows its English sentences.
  for (const files of others) assert.deepEqual(files.filter((code) => !core.includes(code)), []);
});

test('no key occurs in two files', async () => {
  const keys = (await wordsByFolder('en')).flatMap(Object.keys);
  assert.equal(new Set(keys).size, keys.length);
});

for (const code of Object.keys(LANGUAGES)) {
  test(`${code} has only keys that English has, with the same placeholders`, async () => {
    const words = await read(code);
    for (const [key, sentence] of Object.entries(words)) {
      assert.ok(sentence.length, key);
      assert.deepEqual(places(sentence), places(english[key] ?? `${key} is not in en.js`), key);
    }
  });
}

test('the languages that must be complete are complete', async () => {
  for (const code of WHOLE) assert.deepEqual(Object.keys(await read(code)).sort(), Object.keys(english).sort());
});

const sources = (folder) => readdirSync(new URL(folder, web), { withFileTypes: true }).flatMap((entry) => {
  if (entry.isDirectory()) return entry.name === 'messages' ? [] : sources(`${folder}${entry.name}/`);
  return [readFileSync(new URL(folder + entry.name, web), 'utf8')];
});
const all = ['js/', 'board/', 'eye/'].flatMap(sources);

test('every sentence that the code uses exists', () => {
  const asked = all.flatMap((source) => [...source.matchAll(/\bt\('([\w.]+)'/g)].map(([, key]) => key));
  assert.ok(asked.length > 80);
  assert.deepEqual([...new Set(asked)].filter((key) => !(key in english)), []);
});

test('the code uses every sentence', () => {
  const text = all.join('\n');
  const stems = [...text.matchAll(/['`]((?:[a-z_]+\.)+(?:[a-z_]+_)?)\$\{/g)].map(([, stem]) => stem);
  assert.deepEqual(Object.keys(english).filter((key) => !text.includes(`'${key}'`) && !stems.some((stem) => key.startsWith(stem))), []);
});

test('the person’s choice has priority over the browser’s language, and English comes last', () => {
  assert.equal(pickLanguage(['es-MX', 'en'], null), 'es');
  assert.equal(pickLanguage(['es-MX', 'en'], 'zh'), 'zh');
  assert.equal(pickLanguage(['qaa', 'zh-Hant-TW'], null), 'zh');
  assert.equal(pickLanguage(['qaa'], 'xx'), 'en');
});

test('the accessible name of a link begins with its visible text', async () => {
  for (const code of Object.keys(LANGUAGES)) {
    const { like, like_long: name } = { ...await read('en'), ...await read(code) };
    assert.equal(name.slice(0, like.length).toLowerCase(), like.toLowerCase(), code);
  }
});

test('no sentence contains a term that only this project uses, or asks for a choice without naming the options', async () => {
  const odd = /by itself|as if it had never been|begin anew|hand near|choose a mode|elige un modo|选择(一个)?模式/i;
  for (const code of Object.keys(LANGUAGES)) for (const [key, sentence] of Object.entries(await read(code))) assert.doesNotMatch(sentence, odd, `${code} ${key}`);
});

test('the document and the pairing page contain their own sentences in each language', async () => {
  const literal = (path, name) => {
    const [, text] = readFileSync(new URL(path, web), 'utf8').match(new RegExp(`${name} = (\\{\\n[^]*?\\n *\\});`)) ?? [];
    return new Function(`return ${text}`)();
  };
  for (const words of [literal('index.html', 'var words'), literal('pair/pair.js', 'const WORDS')]) {
    assert.deepEqual([...WHOLE, ...Object.keys(words)].filter((code) => !(code in words && code in LANGUAGES)), []);
    for (const [code, own] of Object.entries(words)) {
      assert.deepEqual(Object.keys(own), Object.keys(words.en));
      if ('emergency_stop' in own) assert.equal(own.emergency_stop, (await read(code)).emergency_stop);
    }
  }
});
