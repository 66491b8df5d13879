// Joined files have the same tokens as the modules; only comments and layout are removed.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readFileSync, readdirSync } from 'node:fs';
import { test } from 'node:test';

const python = process.env.PYTHON;
const web = new URL('../../web/', import.meta.url);
const { default: ts } = await import('typescript').catch(() => ({ default: null }));

const tokens = (text) => {
  const file = ts.createSourceFile('x.js', text, ts.ScriptTarget.ES2022, false, ts.ScriptKind.JS);
  assert.deepEqual(file.parseDiagnostics.map(({ messageText }) => messageText), []);
  const found = [];
  const visit = (node) => {
    const parts = [];
    ts.forEachChild(node, (child) => void parts.push(child));
    if (parts.length) parts.forEach(visit);
    else {
      const own = text.slice(ts.skipTrivia(text, node.pos), node.end);
      // An empty block may contain a comment; strings stay unchanged.
      found.push(/^[{[(]/.test(own) ? own.replace(/\/\/.*|\/\*[^]*?\*\//g, '').replace(/\s/g, '') : own);
    }
  };
  visit(file);
  return found;
};

const modules = (folder) => readdirSync(new URL(folder, web), { withFileTypes: true }).flatMap((entry) =>
  entry.isDirectory() ? modules(`${folder}${entry.name}/`) : entry.name.endsWith('.js') ? [`${folder}${entry.name}`] : []);

test('each joined module has the same tokens as its source', { skip: !ts || !python }, () => {
  const names = modules('js/');
  assert.ok(names.length > 50);
  const program = 'import json, pathlib, sys; from web.bundle import shrink;'
    + 'print(json.dumps([shrink(pathlib.Path(n).read_text("utf-8")) for n in sys.argv[1:]]))';
  const paths = names.map((name) => new URL(name, web).pathname);
  const shrunk = JSON.parse(execFileSync(python, ['-c', program, ...paths], { cwd: new URL('../../', import.meta.url) }));
  names.forEach((name, i) => assert.deepEqual(tokens(shrunk[i]), tokens(readFileSync(paths[i], 'utf8')), name));
});
