"""EfficientNet-Lite0 up to its eighth block, run by OpenCV from a file beside this module.

Source: Tan and Le (2019), and Google's "Lite" variants of 2020, with ReLU6 and without squeeze and
excitation. Normalisation is folded into the filters before it, so that the net has only
convolutions. NOTICE.txt says where the weights come from.
"""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.errors import ConfigurationError, need, told_as

Floats = NDArray[np.float32]
WIDTH, HEIGHT = 160, 128
"""Size of the net's input in pixels; the camera's 160x120 is stretched slightly."""
CHANNELS, ROWS, COLUMNS = 80, 8, 10
"""Shape of the output: one number for each channel in each part of the picture."""
GREY, RANGE = 127.0, 128.0
"""The net was trained on inputs (grey level - `GREY`) / `RANGE`."""
_HERE = Path(__file__).parent


class Network:
    """The net, with the mean and standard deviation of its outputs.

    Raises:
        ConfigurationError: If the net's files are missing or damaged.
    """

    def __init__(self) -> None:
        cv2 = need("cv2", "a learner of the kind eyes", "camera")
        what = "the files of the learner eyes cannot be read; install drivelesson again"
        with told_as(ConfigurationError, what, OSError, ValueError, cv2.error):
            usual, spread = np.load(_HERE / "usual.npy", allow_pickle=False)
            file = np.frombuffer((_HERE / "net.onnx").read_bytes(), np.uint8)
            self._net: Any = cv2.dnn.readNetFromONNX(file)
        self.usual: Floats = usual[:, None, None]
        self.spread: Floats = spread[:, None, None]
        # OpenCV's net stores its input, so two threads must not use one net at the same time.
        self._lock = threading.Lock()

    def run(self, rgb: NDArray[np.uint8]) -> Floats:
        """Return the outputs for a picture of shape (128, 160, 3): shape (80, 8, 10).

        Each channel is standardised: `usual` is its mean and `spread` its standard deviation over a
        set of photographs.
        """
        picture = (rgb.astype(np.float32) - GREY) / RANGE
        with self._lock:
            self._net.setInput(np.ascontiguousarray(picture.transpose(2, 0, 1)[None]))
            outputs = self._net.forward()[0]
        standardised: Floats = (outputs - self.usual) / self.spread
        return standardised
