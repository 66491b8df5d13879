// The lessons of each language are parsed completely, and no Markdown syntax is left in their text.

import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';

import { piecesIn, wordsIn } from '../../web/board/markdown.js';
import { wordsOf } from './words.mjs';

test('Markdown is parsed into pieces of text, and links lose their address', () => {
  const kinds = wordsIn('a **b** *c* `d` [e](f.md).').map(({ kind, text }) => `${kind} ${text}`);
  assert.deepEqual(kinds, ['text a ', 'strong b', 'text  ', 'em c', 'text  ', 'code d', 'text  ', 'text e', 'text .']);
});

for (const language of ['en', 'es', 'zh']) {
  test(`the file has three lessons and an answer sheet: ${language}`, async () => {
    const seen = Object.values(await wordsOf(language));
    const pieces = piecesIn(readFileSync(new URL(`../../docs/lessons/${language}.md`, import.meta.url), 'utf8'));
    const kinds = pieces.map(({ kind }) => kind).join(' ');
    assert.equal(kinds, `h1 p${' h2 p quote table p'.repeat(3)} h2 ul`);
    const said = JSON.stringify(pieces);
    assert.doesNotMatch(said, /\*|`|>|\]\(/);
    for (const piece of pieces) {
      if (piece.kind === 'quote') assert.deepEqual([piece.words[0].kind, piece.words[2].kind], ['strong', 'code'], 'a quote has a title and a command');
      if (piece.kind === 'ul') assert.equal(piece.items.length, 3);
      if (piece.kind !== 'table') continue;
      const minutes = piece.rows.map(([first]) => Number(first[0].text));
      assert.ok(minutes.every((n) => n > 0) && Math.abs(minutes.reduce((a, b) => a + b) - 42.5) <= 2.5, String(minutes));
      // The names in a step must be those on the page; they are marked, and have a capital or quotes.
      const texts = piece.rows.flat(2).map(({ kind, text }) => (kind === 'text' ? (text.match(/“[^”]+”/g) ?? []).map((one) => one.slice(1, -1)) : /^[¿¡]?\p{Lu}/u.test(text) ? [text] : []));
      const named = texts.flat().filter((one) => !seen.some((sentence) => sentence.startsWith(one) || sentence === one.toLowerCase()));
      assert.deepEqual(named, []);
      assert.ok(piece.rows.every((row) => row.length === piece.head.length));
    }
  });
}
