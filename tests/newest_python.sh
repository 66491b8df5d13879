#!/bin/sh
# Prints the newest Python after 3.11 on this machine that has venv; prints nothing if there is none.
# All versions of pyenv count, including those that pyenv's own commands do not run now.
for version in 3.15 3.14 3.13 3.12; do
  for python in "python$version" "${PYENV_ROOT:-$HOME/.pyenv}/versions/$version".*/bin/python; do
    if "$python" -c 'import ensurepip, venv' > /dev/null 2>&1; then
      command -v "$python"
      exit
    fi
  done
done
