#!/bin/sh
# rosbags 0.11.9 (numpy 2.4.6): integers in a field of floats are written as numbers near zero.
#
# Guess before running: serialize_cdr() converts the array of a field to the field's type, or refuses another type, as
# it refuses a list.
# Outcome: wrong. It writes the array's bytes unchanged, if their number fits. Wheel angles of np.array([0, 1, 2]),
# which NumPy stores as integers, are read back as 0, 5e-324 and 1e-323, so the wheels stand still. Ranges in
# millimetres as int32 become 0 m, and byte-swapped floats, as some files have them, become noise. Only items of
# another size are refused. serialize_ros1() does the same with integers.
#
# Our program reads bags, but writes none.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check rosbags==0.11.9 numpy==2.4.6
"$folder/env/bin/python" - <<'PY'
import numpy as np
from rosbags.typesys import Stores, get_typestore

store = get_typestore(Stores.ROS2_JAZZY)
header = store.types["std_msgs/msg/Header"](
    stamp=store.types["builtin_interfaces/msg/Time"](sec=1, nanosec=0), frame_id="base"
)
JOINTS, SCAN = "sensor_msgs/msg/JointState", "sensor_msgs/msg/LaserScan"


def angles(position: np.ndarray) -> np.ndarray:
    names = [f"wheel{number}" for number in range(len(position))]
    none = np.array([], np.float64)
    message = store.types[JOINTS](header=header, name=names, position=position, velocity=none, effort=none)
    over_ros1 = store.deserialize_ros1(store.serialize_ros1(message, JOINTS), JOINTS).position
    back = store.deserialize_cdr(store.serialize_cdr(message, JOINTS), JOINTS).position
    assert np.array_equal(over_ros1, back)
    return back


def ranges(values: np.ndarray) -> np.ndarray:
    settings = ("angle_min", "angle_max", "angle_increment", "time_increment", "scan_time", "range_min", "range_max")
    message = store.types[SCAN](
        header=header, ranges=values, intensities=np.array([], np.float32), **dict.fromkeys(settings, 1.0)
    )
    return store.deserialize_cdr(store.serialize_cdr(message, SCAN), SCAN).ranges


right, whole = angles(np.array([0.0, 1.0, 2.0])), angles(np.array([0, 1, 2]))
millimetres, swapped = ranges(np.array([500, 1500], np.int32)), ranges(np.array([0.5, 1.5], ">f4"))
print("angles:", right, whole, "ranges:", millimetres, swapped)
try:
    ranges(np.array([0.5, 1.5], np.float64))
    refusal = None
except ValueError as error:
    refusal = str(error)
print("float64 in float32[]:", refusal)
assert right.tolist() == [0.0, 1.0, 2.0] and refusal is not None
assert whole.tolist() == np.array([0, 1, 2]).view(np.float64).tolist() and whole.max() < 1e-300
assert millimetres.max() < 1e-40 and np.abs(swapped).max() < 1e-4
PY
