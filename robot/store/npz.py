"""Reads untrusted `.npz` files of NumPy: limits sizes, checks headers, and rejects pickles."""

from __future__ import annotations

import io
import math
import struct
import zipfile
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.lib.format import read_array_header_1_0, read_array_header_2_0, read_magic
from numpy.typing import NDArray

from robot.errors import RecordingError

_MAX_MEMBERS = 512
_MAX_HEADER = 1 << 17
_LOCAL = struct.Struct("<4s22xHH")
"""A zip's local header: the signature, and the lengths of the name and of the extra field."""


def read_arrays(data: bytes, *, max_bytes: int, only: str | None = None) -> dict[str, NDArray[Any]]:
    """Return the arrays of an `.npz`, read-only. A file that would unpack to more than `max_bytes`
    is refused before its arrays are read."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = archive.infolist()
            if len(members) > _MAX_MEMBERS or len({m.filename for m in members}) < len(members):
                raise RecordingError("the file has too many arrays, or two with the same name")
            if sum(m.file_size for m in members) > max_bytes:
                raise RecordingError(f"the file unpacks to more than {max_bytes >> 20} MB")
            return {
                member.filename.removesuffix(".npy"): _read_array(_bytes_of(archive, member, data))
                for member in members
                if only is None or member.filename == f"{only}.npy"
            }
    except RecordingError:
        raise
    except Exception as error:  # zipfile, zlib, lzma and numpy raise many types of errors
        raise RecordingError(f"the file is damaged: {error}") from error


def _bytes_of(archive: zipfile.ZipFile, member: zipfile.ZipInfo, data: bytes) -> memoryview:
    """Return a member's bytes; they are not copied if the member is not compressed."""
    if member.compress_type != zipfile.ZIP_STORED or member.flag_bits & 1:
        return memoryview(archive.read(member))
    signature, name_length, extra_length = _LOCAL.unpack_from(data, member.header_offset)
    start = member.header_offset + _LOCAL.size + name_length + extra_length
    part = memoryview(data)[start : start + member.file_size]
    if signature != b"PK\x03\x04" or len(part) != member.file_size:
        raise RecordingError("the file was cut short")
    if zlib.crc32(part) != member.CRC:
        raise RecordingError("a checksum does not match")
    return part


def _read_array(data: memoryview) -> NDArray[Any]:
    """Read one `.npy`, whose header must match the number of its bytes."""
    file = io.BytesIO(data[:_MAX_HEADER])
    if read_magic(file) == (1, 0):
        shape, is_fortran, dtype = read_array_header_1_0(file)
    else:
        shape, is_fortran, dtype = read_array_header_2_0(file)
    start = file.tell()
    if dtype.hasobject:
        raise RecordingError("the file contains pickled objects, which are never opened")
    if math.prod(shape) * dtype.itemsize != len(data) - start or min(shape, default=0) < 0:
        raise ValueError(f"an array's header says {shape}, but its bytes do not match")
    return np.frombuffer(data, dtype, offset=start).reshape(shape, order="F" if is_fortran else "C")


def write_arrays(arrays: Mapping[str, NDArray[Any]], *, is_packed: bool = False) -> bytes:
    """Return the bytes of an `.npz` with these arrays, never pickled; compressed if `is_packed`."""
    file = io.BytesIO()
    packing = zipfile.ZIP_DEFLATED if is_packed else zipfile.ZIP_STORED
    with zipfile.ZipFile(file, "w", packing, compresslevel=1) as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w") as member:
                np.lib.format.write_array(member, np.asanyarray(array), allow_pickle=False)
    return file.getvalue()
