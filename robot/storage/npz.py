"""NumPy's `.npz` files from anywhere: opened within bounds, never a pickle, no header believed."""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Mapping
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from robot.errors import RecordingError

_MAX_MEMBERS = 64


def read_arrays(
    file: BinaryIO, *, max_bytes: int, only: str | None = None
) -> dict[str, NDArray[Any]]:
    """Return the arrays of an `.npz`, by name.

    Args:
        file: The file, seekable.
        max_bytes: A file that would unpack to more is refused before anything is unpacked.
        only: Read this array alone.

    Raises:
        RecordingError: If it is none, damaged, too large, or holds pickles.
    """
    try:
        with zipfile.ZipFile(file) as archive:
            members = archive.infolist()
            if len(members) > _MAX_MEMBERS or sum(m.file_size for m in members) > max_bytes:
                raise RecordingError(f"it unpacks to more than {max_bytes >> 20} MB")
            return {
                member.filename.removesuffix(".npy"): _read_array(archive.read(member))
                for member in members
                if only is None or member.filename == f"{only}.npy"
            }
    except RecordingError:
        raise
    except (zipfile.BadZipFile, ValueError, EOFError, OSError, RuntimeError) as error:
        # RuntimeError: an encrypted member; NotImplementedError, one of its kind: unknown packing.
        raise RecordingError(str(error)) from error
    except Exception as error:  # zlib and lzma have errors of their own
        raise RecordingError(f"it is damaged: {error}") from error


def write_arrays(arrays: Mapping[str, NDArray[Any]], *, is_packed: bool = False) -> bytes:
    """Return the bytes of an `.npz` with these arrays, never pickled; deflated if `is_packed`.

    Raises:
        ValueError: If an array holds objects.
    """
    file = io.BytesIO()
    packing = zipfile.ZIP_DEFLATED if is_packed else zipfile.ZIP_STORED
    with zipfile.ZipFile(file, "w", packing, compresslevel=1) as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w") as member:
                np.lib.format.write_array(member, np.asanyarray(array), allow_pickle=False)
    return file.getvalue()


def _read_array(data: bytes) -> NDArray[Any]:
    """Read one `.npy`; its header is believed only where the bytes are really there."""
    file = io.BytesIO(data)
    version = np.lib.format.read_magic(file)
    read_header = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }.get(version)
    if read_header is None:
        raise ValueError(f"an array of format {version}")
    shape, fortran, dtype = read_header(file)
    if dtype.hasobject:
        raise RecordingError("it holds pickled objects, which are never opened")
    if math.prod(shape) * dtype.itemsize != len(data) - file.tell() or min(shape, default=0) < 0:
        raise ValueError(f"an array whose header says {shape} but whose bytes say otherwise")
    array = np.frombuffer(data, dtype, offset=file.tell()).copy()
    return array.reshape(shape, order="F" if fortran else "C")
