#!/usr/bin/env bash
# MicroPython 1.25.0 (npm: @micropython/micropython-webassembly-pyscript): json.dumps writes invalid JSON for an
# array.
#
# Guess before running: `json.dumps` of a reading in an `array` (the type of ADC buffers) raises TypeError, as in
# CPython.
# Outcome: wrong. It writes the array's repr, `array('H', [512, 7])`, into the text and raises no error; a `range` is
# written in the same way. The message is sent, but no JSON reader accepts it, not even MicroPython's own
# `json.loads`.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-audit --no-fund @micropython/micropython-webassembly-pyscript@1.25.0
cat > run.mjs <<'JS'
import { loadMicroPython } from './node_modules/@micropython/micropython-webassembly-pyscript/micropython.mjs';
const lines = [];
const python = await loadMicroPython({ stdout: (line) => lines.push(line), linebuffer: true });
python.runPython(`
import json, sys
from array import array
print(sys.version)
for value in ({"adc": array("H", [512, 7])}, {"steps": range(3)}):
    text = json.dumps(value)
    try:
        json.loads(text)
        back = "read"
    except ValueError:
        back = "refused by its own loads"
    print(text, "->", back)
`);
console.log(lines.join('\n'));
const expected = ['{"adc": array(\'H\', [512, 7])} -> refused by its own loads', '{"steps": range(0, 3)} -> refused by its own loads'];
process.exit(JSON.stringify(lines.slice(1)) === JSON.stringify(expected) ? 0 : 1);
JS
node run.mjs
