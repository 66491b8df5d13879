#!/bin/sh
# cantools 45.1.0 (DBC): a stop button that is released is true, and a distance that becomes invalid cannot be compared.
#
# Guess before running: decode() gives numbers, and where a DBC file names a number, something that is still one: a 0
# that is named "released" is false, and a distance of which 255 is named "invalid" can be compared with a limit.
# Outcome: wrong in both. A named number is an object that equals its name only: it is true, and does not equal 0, and
# it has no order and no hash. So `if message["stop"]:` stops the robot for ever, `message["stop"] == 0` is false, and
# `message["distance"] < 0.5` works until the sensor sees nothing, and raises a TypeError then, the first time in the
# middle of a drive. `.value` is the number before scaling: 255, where the distance is 25.5 m. decode_choices=False
# gives plain numbers.
#
# Our robots use no CAN bus.
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
