import assert from 'node:assert/strict';
import { readFileSync, readdirSync } from 'node:fs';
import { test } from 'node:test';

import { LANGUAGES, pickLanguage } from '../../web/js/i18n.js';
import { FOLDERS, wordsByFolder, wordsOf as read } from './words.mjs';

const web = new URL('../../web/', import.meta.url);
const english = await read('en');
/** The languages that come with the page; others may be half done. */
const WHOLE = ['en', 'es', 'zh'];
const places = (sentence) => [...sentence.matchAll(/\{(\w+)\}/g)].map(([, name]) => name).sort();

test('each language that can be chosen has a file, and each file can be chosen', () => {
  const [core, ...others] = FOLDERS.map((folder) => readdirSync(new URL(folder, web)).map((name) => name.replace('.js', '')));
  assert.deepEqual(core.sort(), Object.keys(LANGUAGES).sort());
  // An extension may lack a language: there it speaks English.
  for (const files of others) assert.deepEqual(files.filter((code) => !core.includes(code)), []);
});

test('no sentence stands in two files', async () => {
  const keys = (await wordsByFolder('en')).flatMap(Object.keys);
  assert.equal(new Set(keys).size, keys.length);
});

for (const code of Object.keys(LANGUAGES)) {
  test(`${code} says nothing that English does not say, with the same places to fill`, async () => {
    const words = await read(code);
    for (const [key, sentence] of Object.entries(words)) {
      assert.ok(sentence.length, key);
      assert.deepEqual(places(sentence), places(english[key] ?? `${key} is not in en.js`), key);
    }
  });
}

test('the languages that come with the page are whole', async () => {
  for (const code of WHOLE) assert.deepEqual(Object.keys(await read(code)).sort(), Object.keys(english).sort());
});

const sources = (folder) => readdirSync(new URL(folder, web), { withFileTypes: true }).flatMap((entry) => {
  if (entry.isDirectory()) return entry.name === 'messages' ? [] : sources(`${folder}${entry.name}/`);
  return [readFileSync(new URL(folder + entry.name, web), 'utf8')];
});
const all = ['js/', 'board/', 'eye/'].flatMap(sources);

test('every sentence that is asked for is there', () => {
  const asked = all.flatMap((source) => [...source.matchAll(/\bt\('([\w.]+)'/g)].map(([, key]) => key));
  assert.ok(asked.length > 80);
  assert.deepEqual([...new Set(asked)].filter((key) => !(key in english)), []);
});

test('every sentence is used', () => {
  const text = all.join('\n');
  const stems = [...text.matchAll(/['`]((?:[a-z_]+\.)+(?:[a-z_]+_)?)\$\{/g)].map(([, stem]) => stem);
  assert.deepEqual(Object.keys(english).filter((key) => !text.includes(`'${key}'`) && !stems.some((stem) => key.startsWith(stem))), []);
});

test('the person chooses before the browser does, and English comes last', () => {
  assert.equal(pickLanguage(['es-MX', 'en'], null), 'es');
  assert.equal(pickLanguage(['es-MX', 'en'], 'zh'), 'zh');
  assert.equal(pickLanguage(['qaa', 'zh-Hant-TW'], null), 'zh');
  assert.equal(pickLanguage(['qaa'], 'xx'), 'en');
});

test('the name of a link begins with the words that are seen on it', async () => {
  for (const code of Object.keys(LANGUAGES)) {
    const { like, like_long: name } = { ...await read('en'), ...await read(code) };
    assert.equal(name.slice(0, like.length).toLowerCase(), like.toLowerCase(), code);
  }
});

test('no sentence says what is private to this project, or asks for a choice without saying which', async () => {
  const odd = /by itself|as if it had never been|begin anew|hand near|choose a mode|elige un modo|选择(一个)?模式/i;
  for (const code of Object.keys(LANGUAGES)) for (const [key, sentence] of Object.entries(await read(code))) assert.doesNotMatch(sentence, odd, `${code} ${key}`);
});

test('the document, and the page that pairs, speak each language by themselves', async () => {
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
