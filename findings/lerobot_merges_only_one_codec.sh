#!/bin/sh
# lerobot 0.6.1 (Python 3.12, 3.13): datasets whose films have different codecs cannot be merged, but datasets with
# other differences in the encoder's settings can.
#
# Guess before running: the validation of a merge says that it ignores information about the encoder, so a dataset in
# H.264 can be merged with one in AV1, which lerobot itself records.
# Outcome: wrong. crf, key frames, preset and backend may differ, but the codec and the pixel format may not. The
# error says only that the same features are expected.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for python in python3.13 python3.12 "${PYENV_ROOT:-$HOME/.pyenv}"/versions/3.1[23].*/bin/python; do
  "$python" -m venv "$folder/env" 2>/dev/null && break
done
"$folder/env/bin/pip" install --quiet 'lerobot[dataset]==0.6.1'
"$folder/env/bin/python" - <<'EOF'
from lerobot.datasets.feature_utils import features_equal_for_merge


def film(**info: object) -> dict:
    said = {"video.codec": "av1", "video.pix_fmt": "yuv420p", "video.crf": 30, "video.g": 2}
    said |= {f"video.{name}": value for name, value in info.items()}
    return {"camera": {"dtype": "video", "shape": (8, 8, 3), "names": ["height", "width", "channels"], "info": said}}


merges = {name: features_equal_for_merge(film(), film(**{name: value})) for name, value in (("crf", 18), ("g", 10), ("codec", "h264"), ("pix_fmt", "yuv444p"))}
print(merges)
assert merges == {"crf": True, "g": True, "codec": False, "pix_fmt": False}
EOF
