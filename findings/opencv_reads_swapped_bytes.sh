#!/bin/sh
# opencv-python-headless 5.0.0.93, onnxruntime 1.32.0 (numpy 2.4.6): the bytes of a byte-swapped array are read in the
# wrong order, so a depth of 1000 mm becomes 59395 mm.
#
# Guess before running: both libraries convert an array of the dtype '>u2' or '>f4', as SciPy and faiss do, or refuse
# it, as PyAV and usearch do.
# Outcome: wrong for both. They check the kind and the size of the numbers, but not their byte order, and raise no
# error. Such arrays are common in recordings: the pixels of a 16-bit PGM are big-endian, as are ROS images with
# is_bigendian, and HDF5, Zarr and .npy keep the byte order in which they were written. NumPy itself calculates
# correctly with such arrays, so plots and means look right until a picture is resized or given to a network. Swapped
# floats become numbers near zero. array.astype(array.dtype.newbyteorder("=")) before the call helps.
#
# Our program gives OpenCV only bytes and arrays of its own.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check opencv-python-headless==5.0.0.93 \
  onnxruntime==1.32.0 onnx==1.23.2 numpy==2.4.6
"$folder/env/bin/python" - <<'PY'
import cv2
import numpy as np
import onnxruntime
from onnx import TensorProto, helper

HEADER = b"P5 2 2 65535\n"
file = HEADER + np.array([[1000, 2000], [3000, 4000]], ">u2").tobytes()  # depths in mm
right = cv2.imdecode(np.frombuffer(file, np.uint8), cv2.IMREAD_UNCHANGED)
depth = np.frombuffer(file, ">u2", offset=len(HEADER)).reshape(2, 2)
assert np.array_equal(depth, right)
native = depth.astype(depth.dtype.newbyteorder("="))


def resized(array: np.ndarray) -> list:
    return cv2.resize(array, (2, 2), interpolation=cv2.INTER_NEAREST).tolist()


shapes = [helper.make_tensor_value_info(name, TensorProto.FLOAT, [2, 2]) for name in ("seen", "same")]
graph = helper.make_graph([helper.make_node("Identity", ["seen"], ["same"])], "network", shapes[:1], shapes[1:])
model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
network = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
(answer,) = network.run(None, {"seen": depth.astype(">f4")})
(native_answer,) = network.run(None, {"seen": native.astype(np.float32)})
print("NumPy", depth.tolist(), "OpenCV", resized(depth), "ONNX Runtime", answer.tolist())
assert resized(native) == native_answer.tolist() == [[1000, 2000], [3000, 4000]]
assert resized(depth) == [[59395, 53255], [47115, 40975]]
assert cv2.minMaxLoc(depth)[:2] == (40975, 59395)
assert 0 < np.abs(answer).max() < 1e-36
PY
