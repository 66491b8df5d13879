#!/bin/sh
# lerobot 0.6.1 (Python 3.12): data sets whose films differ in the codec do not merge, though those
# that differ in every other setting of the encoder do.
#
# Guess before running: the validation of a merge says that information on the encoder is not
# considered, so a set in H.264 merges with one in AV1, as lerobot itself records.
# Outcome: wrong. crf, key frames, preset and backend may differ; the codec and the format of the
# pixels may not, and the error says only that the same features are expected.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.12 -m venv "$folder/env"
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
