"""A net as the bytes of an ONNX file: the few messages of the format that a net of ours needs.

Source: onnx.proto of ONNX, opset 11, in the wire format of protocol buffers. A net here has one
input and one output; writing it takes less than the library `onnx` does.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

_FLOAT, _IR_VERSION, _OPSET = 1, 7, 11


class OnnxWriter:
    """Collects a net's nodes in order, and writes them down."""

    def __init__(self) -> None:
        self._nodes: list[bytes] = []
        self._constants: list[bytes] = []

    def constant(self, name: str, values: NDArray[np.float32]) -> str:
        shape = b"".join(_number(1, length) for length in values.shape)
        data = np.ascontiguousarray(values, "<f4").tobytes()
        self._constants.append(shape + _number(2, _FLOAT) + _text(8, name) + _bytes(9, data))
        return name

    def node(
        self,
        operator: str,
        inputs: Sequence[str],
        output: str,
        settings: Mapping[str, int | Sequence[int]] | None = None,
    ) -> str:
        parts = [_text(1, name) for name in inputs]
        parts += [_text(2, output), _text(4, operator)]
        parts += [_bytes(5, _attribute(name, value)) for name, value in (settings or {}).items()]
        self._nodes.append(b"".join(parts))
        return output

    def write(self, entry: tuple[str, Sequence[int]], result: tuple[str, Sequence[int]]) -> bytes:
        """Return the file, given name and shape of the net's input and output."""
        graph = b"".join(_bytes(1, node) for node in self._nodes) + _text(2, "net")
        graph += b"".join(_bytes(5, constant) for constant in self._constants)
        graph += _bytes(11, _value(*entry)) + _bytes(12, _value(*result))
        return _number(1, _IR_VERSION) + _bytes(7, graph) + _bytes(8, _number(2, _OPSET))


def _attribute(name: str, value: int | Sequence[int]) -> bytes:
    if isinstance(value, int):
        return _text(1, name) + _number(3, value) + _number(20, 2)
    return _text(1, name) + b"".join(_number(8, one) for one in value) + _number(20, 7)


def _value(name: str, shape: Sequence[int]) -> bytes:
    dimensions = b"".join(_bytes(1, _number(1, length)) for length in shape)
    return _text(1, name) + _bytes(2, _bytes(1, _number(1, _FLOAT) + _bytes(2, dimensions)))


def _number(field: int, value: int) -> bytes:
    return _varint(field << 3) + _varint(value)


def _text(field: int, value: str) -> bytes:
    return _bytes(field, value.encode())


def _bytes(field: int, value: bytes) -> bytes:
    return _varint(field << 3 | 2) + _varint(len(value)) + value


def _varint(value: int) -> bytes:
    parts = []
    while value > 127:
        parts.append(value & 127 | 128)
        value >>= 7
    return bytes([*parts, value])
