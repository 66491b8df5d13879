#!/usr/bin/env bash
# numpy 2.4.6 and 2.5.5 (PyPI, Python 3.12 or newer): the memory that a Cholesky factorisation needs.
#
# Guess before running: in both versions `numpy.linalg.cholesky` needs only the memory of its result, so a memory
# limit that is enough for one version is enough for the other.
# Outcome: wrong. 2.4.6 needs the memory of one matrix, and 2.5.5 that of two, for the lower factor and for the upper
# one.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for python in python3.13 python3.12 "${PYENV_ROOT:-$HOME/.pyenv}"/versions/3.1[23].*/bin/python; do
  "$python" -c 'import ensurepip, venv' 2> /dev/null && break
done
for version in 2.4.6 2.5.5; do
  "$python" -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --disable-pip-version-check "numpy==$version"
  "$folder/$version/bin/python" - <<'PY' >> "$folder/seen"
import tracemalloc

import numpy as np

size = 385
matrix = np.eye(size) + 0.01
np.linalg.cholesky(matrix)
taken = []
for upper in (False, True):
    tracemalloc.start()
    np.linalg.cholesky(matrix, upper=upper)
    taken.append(round(tracemalloc.get_traced_memory()[1] / matrix.nbytes))
    tracemalloc.stop()
print(np.__version__, *taken)
PY
done
cat "$folder/seen"
diff "$folder/seen" - <<'SEEN'
2.4.6 1 1
2.5.5 2 2
SEEN
