#!/bin/sh
# Prints the newest Python after 3.11 that this machine has, with venv; nothing where there is none.
# Versions of pyenv count, though its commands run only the ones that are chosen.
for version in 3.15 3.14 3.13 3.12; do
  for python in "python$version" "${PYENV_ROOT:-$HOME/.pyenv}/versions/$version".*/bin/python; do
    if "$python" -c 'import ensurepip, venv' > /dev/null 2>&1; then
      command -v "$python"
      exit
    fi
  done
done
