#!/bin/sh
# robotpy-wpimath 2026.2.2 (WPILib): after a pause the slew-rate limiter allows the full speed at once.
#
# Guess before running: a SlewRateLimiter of 1/s, whose last output was 0, gives at most a few hundredths at its next
# call, because a robot calls it 50 times a second, however long the robot stood still in between.
# Outcome: wrong. It allows the rate times the time since its last call. If a robot stood for two seconds while its
# program did something else, it goes from 0 to 1 in one call, which the limiter is meant to prevent. The same happens
# in the first call after the limiter was made. In a loop that calls it all the time, as in a test, it is right.
# reset(0.0) immediately before driving off restarts the time.
#
# Our robots do not use WPILib.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check robotpy-wpimath==2026.2.2
"$folder/env/bin/python" - <<'PY'
import time

from wpimath.filter import SlewRateLimiter

PAUSE_S = 2.0


def after_pause(limiter: SlewRateLimiter, *, is_reset: bool) -> float:
    time.sleep(PAUSE_S)
    if is_reset:
        limiter.reset(0.0)
    return limiter.calculate(1.0)


begun = after_pause(SlewRateLimiter(1.0), is_reset=False)
used = SlewRateLimiter(1.0)
assert used.calculate(0.0) == 0.0
jump, smooth = after_pause(used, is_reset=False), after_pause(used, is_reset=True)
print(f"first call: {begun:.3f}; after a pause: {jump:.3f}; after a pause and reset(0.0): {smooth:.3f}")
assert begun == jump == 1.0 and smooth < 0.5
PY
