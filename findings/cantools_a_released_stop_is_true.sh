#!/bin/sh
# cantools 45.1.0 (DBC): a released stop button is truthy, and a distance that becomes invalid cannot be compared.
#
# Guess before running: decode() returns numbers. If a DBC file names a number, the result still behaves like a
# number: a 0 that is named "released" is falsy, and a distance whose value 255 is named "invalid" can be compared
# with a limit.
# Outcome: wrong in both cases. A named number becomes an object that equals only its name. It is truthy, does not
# equal 0, and has neither an order nor a hash. `if message["stop"]:` therefore always stops the robot, and
# `message["stop"] == 0` is false. `message["distance"] < 0.5` works until the sensor sees nothing for the first time,
# perhaps in the middle of a drive, and then raises a TypeError. `.value` is the number before scaling: 255 for a
# distance of 25.5 m. decode_choices=False returns plain numbers.
#
# Our robots do not use a CAN bus.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check cantools==45.1.0
"$folder/env/bin/python" - <<'PY'
import cantools

DBC = """VERSION ""
BU_: Robot
BO_ 100 Front: 2 Robot
 SG_ stop : 0|8@1+ (1,0) [0|1] "" Robot
 SG_ distance : 8|8@1+ (0.1,0) [0|25.5] "m" Robot
VAL_ 100 stop 0 "released" 1 "pressed" ;
VAL_ 100 distance 255 "invalid" ;
"""
front = cantools.database.load_string(DBC, "dbc").get_message_by_name("Front")
near, nothing = front.decode(bytes([0, 4])), front.decode(bytes([0, 255]))
plain = front.decode(bytes([0, 255]), decode_choices=False)


def told(ask) -> object:
    try:
        return ask()
    except TypeError as error:
        return str(error)


found = {
    "stop": (near["stop"], near["stop"] == "released", near["stop"] == 0, bool(near["stop"])),
    "near": near["distance"] < 0.5,
    "nothing": told(lambda: nothing["distance"] < 0.5),
    "hash": told(lambda: hash(nothing["distance"])),
    "value": nothing["distance"].value,
    "plain": plain,
}
print(found)
assert found["stop"][1:] == (True, False, True) and found["near"] is True
assert "not supported" in found["nothing"] and "unhashable" in found["hash"]
assert found["value"] == 255 and plain == {"stop": 0, "distance": 25.5}
PY
