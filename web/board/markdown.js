// The subset of Markdown that the lessons use: headings, paragraphs, quotes, lists, tables, bold, emphasis and code.
// Links lead to documents that the board does not serve, so only their text is shown.
// Pure.

/** @typedef {{kind: 'text' | 'strong' | 'em' | 'code', text: string}} Word */
/**
 * @typedef {{kind: 'h1' | 'h2' | 'p' | 'quote', words: Word[]} | {kind: 'ul', items: Word[][]} | {kind: 'table', head: Word[][], rows: Word[][][]}} Piece
 */

const MARKS = /\*\*(.+?)\*\*|\*(.+?)\*|`(.+?)`|\[(.+?)\]\(.*?\)/g;

/** @param {string} text @returns {Word[]} */
export function wordsIn(text) {
  const words = [];
  let at = 0;
  for (const mark of text.matchAll(MARKS)) {
    if (mark.index > at) words.push({ kind: 'text', text: text.slice(at, mark.index) });
    const [whole, strong, em, code, link] = mark;
    words.push({ kind: strong ? 'strong' : em ? 'em' : code ? 'code' : 'text', text: strong ?? em ?? code ?? link });
    at = mark.index + whole.length;
  }
  if (at < text.length) words.push({ kind: 'text', text: text.slice(at) });
  return /** @type {Word[]} */ (words);
}

/** @param {string} line */
const cells = (line) => line.trim().replace(/^\||\|$/g, '').split('|').map((cell) => wordsIn(cell.trim()));

/** @param {string} text @returns {Piece[]} */
export function piecesIn(text) {
  return text.split(/\n{2,}/).map((block) => block.trim()).filter(Boolean).flatMap((block) => {
    const lines = block.split('\n');
    const heading = /^(#{1,2}) (.*)$/.exec(lines[0]);
    if (heading) return [{ kind: /** @type {'h1' | 'h2'} */ (`h${heading[1].length}`), words: wordsIn(heading[2]) }, ...(lines.length > 1 ? piecesIn(lines.slice(1).join('\n')) : [])];
    if (lines[0].startsWith('|')) return [{ kind: 'table', head: cells(lines[0]), rows: lines.slice(2).map(cells) }];
    const joined = lines.map((line) => line.trim().replace(/^> ?/, '')).join(' ').replace(/(\p{Script=Han}|[，。：；？！、”]) (?=\p{Script=Han}|[“])/gu, '$1');
    if (joined.startsWith('- ')) return [{ kind: 'ul', items: joined.slice(2).split(/ - (?=\*)/).map(wordsIn) }];
    return [{ kind: lines[0].startsWith('>') ? 'quote' : 'p', words: wordsIn(joined) }];
  });
}
