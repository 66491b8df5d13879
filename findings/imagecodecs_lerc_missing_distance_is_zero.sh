#!/bin/sh
# imagecodecs 2026.3.6: with LERC, a codec for rasters of heights and depths, a missing distance becomes 0 m.
#
# Guess before running: lerc_decode(lerc_encode(depth)) returns the same array, because by default no error is
# allowed. NaN, with which depth cameras mark pixels that they could not measure, stays NaN, as with the ZFP codec.
# Outcome: wrong. NaN is stored separately, in a mask that lerc_decode() returns only with masks=True. Without it,
# these pixels contain 0. All other numbers are exact, so a comparison that skips NaN finds no fault. A robot that
# stops at things nearer than 0.2 m stops although there is nothing.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check imagecodecs==2026.3.6 numpy==2.4.6
"$folder/env/bin/python" -W error - <<'PY'
import imagecodecs
import numpy as np

depth = (0.6 + np.arange(1200).reshape(30, 40) / 300).astype(np.float32)
depth[::7, ::3] = np.nan
missing = np.isnan(depth)
decoded = {
    "lerc": imagecodecs.lerc_decode(imagecodecs.lerc_encode(depth)),
    "zfp": imagecodecs.zfp_decode(imagecodecs.zfp_encode(depth)),
}
found = {name: (int(np.isnan(one).sum()), float(np.nanmin(one))) for name, one in decoded.items()}
print(f"{missing.sum()} missing, nearest {np.nanmin(depth):.1f} m; NaN and nearest after each codec: {found}")
lerc = decoded["lerc"]
assert np.array_equal(lerc[~missing], depth[~missing]) and (lerc[missing] == 0).all()
assert np.array_equal(decoded["zfp"], depth, equal_nan=True)
_, is_valid = imagecodecs.lerc_decode(imagecodecs.lerc_encode(depth), masks=True)
assert np.array_equal(is_valid, ~missing)
PY
