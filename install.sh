#!/bin/sh
# `make install` runs this: it puts the command `drivelesson` on the PATH, in a separate environment.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
python=${PYTHON:-python3}

if command -v uv > /dev/null; then
  uv tool install --quiet --force --python "$python" "$here"
  folder=$(uv tool dir --bin)
elif command -v pipx > /dev/null; then
  pipx install --quiet --force --python "$python" "$here"
  folder=${PIPX_BIN_DIR:-$HOME/.local/bin}
else
  make --no-print-directory -C "$here" PYTHON="$python" .venv/.demo
  folder=$HOME/.local/bin
  mkdir -p "$folder"
  ln -sf "$here/.venv/bin/drivelesson" "$folder/drivelesson"
fi

case ":$PATH:" in
  *":$folder:"*) echo "Drivelesson is installed. Start it with: drivelesson" ;;
  *) echo "Drivelesson is installed in $folder, which is not on your PATH yet. Add the folder with:"
     echo "  echo 'export PATH=\"$folder:\$PATH\"' >> ~/.profile && . ~/.profile" ;;
esac
