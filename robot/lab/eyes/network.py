"""EfficientNet-Lite0 up to its eighth block, run by OpenCV.

Source: Tan and Le (2019), and Google's "Lite" variants of 2020: ReLU6, no squeeze and excitation.
Each block widens the channels, filters each by itself and narrows them again (Sandler et al. 2018).
Normalisation is folded into the filters before it, so that the net has only convolutions.
"""

from __future__ import annotations

import threading
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.errors import need
from robot.lab.eyes.onnx_writer import OnnxWriter
from robot.lab.eyes.weights import Weights, load_weights

Floats = NDArray[np.float32]
WIDTH, HEIGHT = 160, 128
"""Size of the pictures that it sees, in pixels; the camera's 160x120 is a little stretched."""
CHANNELS, ROWS, COLUMNS = 80, 8, 10
"""Shape of the output: a number for each channel and part of the picture."""
GREY, RANGE = 127.0, 128.0
"""The grey level that became 0 when it was trained, and how many levels became 1."""
_STEPS = (1, 2, 1, 2, 1, 2, 1, 1)
"""Of each block's filters, in pixels. A block of step 1 with as many channels as the one before
adds what it found to what came in."""
_EPSILON = 1e-3


class Network:
    """The net, and what its outputs usually are."""

    def __init__(self) -> None:
        cv2 = need("cv2", "a learner of the kind eyes", "camera")
        file, self.usual, self.spread = _compiled()
        self._net: Any = cv2.dnn.readNetFromONNX(np.frombuffer(file, np.uint8))
        # OpenCV's net holds its input: two threads at a time would mix up their pictures.
        self._lock = threading.Lock()

    def run(self, rgb: NDArray[np.uint8]) -> Floats:
        """Return its outputs for a picture of shape (128, 160, 3): shape (80, 8, 10).

        They are standardised: by `usual` and `spread`, the mean and standard deviation of each
        channel on the photographs that it was trained with.
        """
        picture = (rgb.astype(np.float32) - GREY) / RANGE
        with self._lock:
            self._net.setInput(np.ascontiguousarray(picture.transpose(2, 0, 1)[None]))
            outputs = self._net.forward()[0]
        standardised: Floats = (outputs - self.usual) / self.spread
        return standardised


@cache
def _compiled() -> tuple[bytes, Floats, Floats]:
    """Return the net as an ONNX file, and its outputs' means and deviations, shape (80, 1, 1).

    Both follow from the last normalisation's own numbers: a block's outputs have those means and
    variances on the photographs, and blocks that add up are taken to add these, too.
    """
    weights, writer = load_weights(), OnnxWriter()
    writer.constant("zero", np.zeros((), np.float32))
    writer.constant("six", np.full((), 6.0, np.float32))
    usual = variance = np.zeros(0, np.float32)
    x = _filter(writer, weights, "picture", "_conv_stem", "_bn0", step=2)
    for number, step in enumerate(_STEPS):
        block = f"_blocks.{number}."
        entry = x
        if number > 0:
            x = _filter(writer, weights, x, f"{block}_expand_conv", f"{block}_bn0")
        x = _filter(writer, weights, x, f"{block}_depthwise_conv", f"{block}_bn1", step=step)
        x = _filter(writer, weights, x, f"{block}_project_conv", f"{block}_bn2", bends=False)
        mean, deviation = weights[f"{block}_bn2.bias"], weights[f"{block}_bn2.weight"]
        if step == 1 and mean.shape == usual.shape:
            x = writer.node("Add", [x, entry], f"{block}sum")
            usual, variance = usual + mean, variance + deviation**2
        else:
            usual, variance = mean, deviation**2
    file = writer.write(("picture", (1, 3, HEIGHT, WIDTH)), (x, (1, CHANNELS, ROWS, COLUMNS)))
    return file, usual[:, None, None], np.sqrt(variance)[:, None, None]


def _filter(
    writer: OnnxWriter,
    weights: Weights,
    x: str,
    name: str,
    norm: str,
    *,
    step: int = 1,
    bends: bool = True,
) -> str:
    """Add a convolution with its normalisation, and ReLU6 if it `bends`; returns its output."""
    kernels = weights[f"{name}.weight"]
    spread: Floats = np.sqrt(weights[f"{norm}.running_var"] + np.float32(_EPSILON))
    scale = weights[f"{norm}.weight"] / spread
    offset = weights[f"{norm}.bias"] - weights[f"{norm}.running_mean"] * scale
    size = kernels.shape[-1]
    # As TensorFlow pads an even side ("same"): the odd pixel at the right and at the bottom.
    before, after = (size - step) // 2, (size - step + 1) // 2
    made = writer.node(
        "Conv",
        [
            x,
            writer.constant(f"{name}.kernels", kernels * scale[:, None, None, None]),
            writer.constant(f"{name}.offset", offset),
        ],
        name,
        {
            "kernel_shape": [size, size],
            "strides": [step, step],
            "pads": [before, before, after, after],
            "group": len(kernels) if "depthwise" in name else 1,
        },
    )
    return writer.node("Clip", [made, "zero", "six"], f"{name}.bent") if bends else made
