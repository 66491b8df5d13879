#!/bin/sh
# python-ev3dev2 2.1.0.post1: two equal speeds cannot be compared, and a speed of zero is truthy.
#
# Guess before running: SpeedPercent, SpeedRPS and the other speeds behave like numbers: two speeds of 50 % are equal,
# a speed can be the key of a dict, 1 rotation a second equals 60 a minute, and a speed of 0 is falsy.
# Outcome: wrong in all four points. `SpeedPercent(50) == SpeedPercent(50)`, and `<`, raise a TypeError about a
# missing argument `motor`, because every comparison needs the speed in counts of a certain motor, which a speed does
# not know. A type with such an `==` has no hash. SpeedPercent(0) is truthy, so `if speed:` does not detect a stopped
# motor. Only `*` works, and only up to 100 percent.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet python-ev3dev2==2.1.0.post1
"$folder/env/bin/python" - <<'EOF'
from collections.abc import Callable

from ev3dev2.motor import SpeedPercent, SpeedRPM, SpeedRPS


def told(ask: Callable[[], object]) -> object:
    try:
        return ask()
    except TypeError as error:
        return str(error)


found = {
    "equal": told(lambda: SpeedPercent(50) == SpeedPercent(50)),
    "less": told(lambda: SpeedPercent(50) < SpeedPercent(60)),
    "units": told(lambda: SpeedRPS(1) == SpeedRPM(60)),
    "hash": told(lambda: hash(SpeedPercent(50))),
    "zero": told(lambda: bool(SpeedPercent(0))),
    "twice": told(lambda: str(SpeedPercent(50) * 2)),
}
print(found)
assert all("'motor'" in found[name] for name in ("equal", "less", "units"))
assert "unhashable" in found["hash"]
assert found["zero"] is True and found["twice"] == "100%"
EOF
