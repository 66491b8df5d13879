#!/usr/bin/env bash
# MicroPython 1.27.0 (npm: @micropython/micropython-webassembly-pyscript): a speed that does not fit into its field
# becomes a backward speed.
#
# Guess before running: struct.pack("<b", 200) raises an error, as in CPython. So do an array of type "b" and a
# bytearray.
# Outcome: wrong. Only the lowest bits are used: 200 in a signed byte is -56, and 70000 in "<h" is 4464. A missing
# value is packed as 0, and a surplus value is left out. On a computer each of these raises an error, so a program
# that was tested there may turn a motor backwards on the hub. bytes([300]) and (70000).to_bytes(2, "little") do raise
# an error.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-audit --no-fund @micropython/micropython-webassembly-pyscript@1.27.0
cat > packed.py <<'PY'
import struct, sys
from array import array


def found(make):
    try:
        return make()
    except Exception as error:
        return type(error).__name__


print(sys.implementation.name)
for values in (
    found(lambda: struct.unpack("<b", struct.pack("<b", 200))[0]),
    found(lambda: struct.unpack("<h", struct.pack("<h", 70000))[0]),
    found(lambda: array("b", [200])[0]),
    found(lambda: bytearray([300])[0]),
    found(lambda: struct.unpack("<bb", struct.pack("<bb", 7))),
    found(lambda: struct.unpack("<b", struct.pack("<b", 7, 8))),
    found(lambda: bytes([300])),
    found(lambda: (70000).to_bytes(2, "little")),
):
    print(values)
PY
cat > run.mjs <<'JS'
import { readFileSync } from 'node:fs';
import { loadMicroPython } from './node_modules/@micropython/micropython-webassembly-pyscript/micropython.mjs';
const python = await loadMicroPython({ stdout: console.log, linebuffer: true });
python.runPython(readFileSync('packed.py', 'utf8'));
JS
hub=$(node run.mjs | tr '\n' ' ')
computer=$(python3 packed.py | tr '\n' ' ')
printf '%s\n' "$hub" "$computer"
[ "$hub" = "micropython -56 4464 -56 44 (7, 0) (7,) ValueError OverflowError " ]
[ "$computer" = "cpython error error OverflowError ValueError error error ValueError OverflowError " ]
