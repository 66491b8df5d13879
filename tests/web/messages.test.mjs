import assert from 'node:assert/strict';
import { readFileSync, readdirSync } from 'node:fs';
import { test } from 'node:test';

import { pickLanguage } from '../../web/js/i18n.js';

const pages = [['the page', '../../web/js/', 60], ["the class's board", '../../web/board/', 20]];

for (const [page, path, least] of pages) {
  const folder = new URL(path, import.meta.url);
  const studies = path.endsWith('/js/') ? (await import(new URL('study/words.js', folder))).default : {};
  const read = async (code) => ({ ...(await import(new URL(`messages/${code}.js`, folder))).default, ...studies[code] });
  const english = await read('en');
  const places = (sentence) => [...sentence.matchAll(/\{(\w+)\}/g)].map(([, name]) => name).sort();

  for (const code of ['es', 'zh']) {
    test(`${page}: ${code} says all that English says, with the same places to fill`, async () => {
      const words = await read(code);
      assert.deepEqual(Object.keys(words), Object.keys(english));
      for (const [key, sentence] of Object.entries(words)) {
        assert.ok(sentence.length, key);
        assert.deepEqual(places(sentence), places(english[key]), key);
      }
    });
  }

  const sources = (below) => readdirSync(new URL(below, folder), { withFileTypes: true }).flatMap((entry) => {
    if (entry.isDirectory()) return entry.name === 'messages' ? [] : sources(`${below}${entry.name}/`);
    return [readFileSync(new URL(below + entry.name, folder), 'utf8')];
  });

  test(`${page}: every sentence that it asks for is there`, () => {
    const asked = sources('./').flatMap((source) => [...source.matchAll(/\bt\('([\w.]+)'/g)].map(([, key]) => key));
    assert.ok(asked.length > least);
    assert.deepEqual([...new Set(asked)].filter((key) => !(key in english)), []);
  });

  test(`${page}: every sentence is used`, () => {
    const all = sources('./').join('\n');
    const stems = [...all.matchAll(/['`]([a-z_]+\.(?:[a-z_]+[._])?)\$\{/g)].map(([, stem]) => stem);
    const unused = Object.keys(english).filter(
      (key) => !all.includes(`'${key}'`) && !stems.some((stem) => key.startsWith(stem)),
    );
    assert.deepEqual(unused, []);
  });
}

test('the person chooses before the browser does, and English comes last', () => {
  assert.equal(pickLanguage(['es-MX', 'en'], null), 'es');
  assert.equal(pickLanguage(['es-MX', 'en'], 'zh'), 'zh');
  assert.equal(pickLanguage(['fr', 'zh-Hant-TW'], null), 'zh');
  assert.equal(pickLanguage(['fr'], 'xx'), 'en');
});
