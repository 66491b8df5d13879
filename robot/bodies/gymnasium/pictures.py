"""Converts any picture of an environment to RGB bytes.

Environments return numbers of different types: bytes, integers or fractions. The channels are last
or first, and may include an alpha channel. A picture may also be the newest frame of a list, or one
part of an observation.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.uint8]
_LEAST_PX = 16
"""Minimum width and height of a picture, in pixels. A smaller array is a game's board or table."""
_MOST_PX = 1920
"""Maximum width and height of a picture, in pixels. Larger pictures are reduced to every n-th
pixel."""
_MOST_CHANNELS = 48
"""Maximum number of channels in a stack of frames. An array with more channels is not a picture."""
_LARGEST = 65535.0
"""Largest number that may stand for white. An observation space with a larger upper bound is
treated as unbounded."""
_MADE_OF_IT = re.compile(r"mask|depth|segment|semantic|label|map|flow|normals|heat", re.I)
"""Names of parts of an observation that are computed from a picture, and that a person does not
want to see."""
_PICTURE = re.compile(r"rgb|image|img|pixel|screen|camera|visual|frame", re.I)


class _Found(NamedTuple):
    """A picture among the parts of an observation."""

    name: str
    pixels: Pixels
    has_colours: bool

    @property
    def rank(self) -> tuple[bool, bool, bool, int]:
        """Key for sorting pictures: the picture that a person prefers to see has the largest
        key."""
        is_made_of_it = _MADE_OF_IT.search(self.name) is not None
        is_called_so = _PICTURE.search(self.name) is not None
        return self.has_colours, not is_made_of_it, is_called_so, self.pixels.size


def picture_in(seen: Any, space: Any = None) -> Pixels | None:
    """Return the picture in an observation; None if there is none.

    If there are several pictures, one with colours is preferred, then one with a picture's name,
    then the largest.

    Args:
        seen: An observation, or a rendering; in a list of frames the newest counts.
        space: The observation's space, if there is one. The space's bounds are the values of black
            and white.

    Returns:
        RGB, shape (height, width, 3), uint8.
    """
    found = max(_pictures(seen, space, ""), key=lambda one: one.rank, default=None)
    if found is None:
        return None
    step = -(-max(found.pixels.shape) // _MOST_PX)
    pixels = found.pixels[::step, ::step]
    return np.ascontiguousarray(np.broadcast_to(pixels, (*pixels.shape[:2], 3)))


def describe(seen: Any) -> str:
    """Describe in words a value that was found instead of a picture."""
    if seen is None:
        return "nothing"
    if isinstance(seen, Mapping):
        return "{" + ", ".join(f"{key}: {describe(seen[key])}" for key in list(seen)[:6]) + "}"
    array = _as_array(seen)
    if array is None and isinstance(seen, Sequence) and not isinstance(seen, str | bytes):
        return "(" + ", ".join(map(describe, seen[:6])) + ")"
    if array is None or not array.shape:
        return f"one {type(seen).__name__}"
    return f"{array.dtype} of shape {'x'.join(map(str, array.shape))}"


def _pictures(seen: Any, space: Any, name: str) -> Iterator[_Found]:
    parts = getattr(space, "spaces", None)
    if isinstance(seen, Mapping):
        for key, part in seen.items():
            of_part = parts.get(key) if isinstance(parts, Mapping) else None
            yield from _pictures(part, of_part, f"{name}.{key}")
        return
    array = _as_array(seen) if parts is None else None
    if array is not None:
        channels = _channels_last(array)
        pixels = None if channels is None else _as_bytes(channels, space)
        if pixels is not None:
            yield _Found(name, pixels, pixels.shape[2] == 3)
    elif isinstance(seen, Sequence) and not isinstance(seen, str | bytes):
        of_parts = parts if isinstance(parts, Sequence) and len(parts) == len(seen) else ()
        for part, of_part in itertools.zip_longest(seen, of_parts):
            yield from _pictures(part, of_part, name)


def _as_array(seen: Any) -> NDArray[Any] | None:
    """Return the numbers of an array, a list of lists, a tensor or an image; None for others."""
    if hasattr(seen, "detach") and hasattr(seen, "cpu"):  # a PyTorch tensor, perhaps on a GPU
        seen = seen.detach().cpu()
    elif hasattr(seen, "convert") and hasattr(seen, "getbands"):  # a Pillow image
        seen = seen.convert("RGB")  # the image may have a palette
    try:
        array = np.asarray(seen)
    except (ValueError, TypeError, RuntimeError):
        # the picture is a list whose items differ in shape
        return None
    return array if array.dtype.kind in "buif" else None


def _channels_last(array: NDArray[Any]) -> NDArray[Any] | None:
    """Return the newest frame, shape (height, width, 1 or 3); None if this is not a picture."""
    while array.ndim > 3 and len(array):
        array = array[-1]
    if array.ndim == 2:
        array = array[:, :, None]
    if array.ndim != 3:
        return None
    is_first = array.shape[2] > _MOST_CHANNELS or (
        array.shape[2] not in (1, 3, 4) and array.shape[0] in (1, 3, 4)
    )
    if is_first:
        array = array.transpose(1, 2, 0)
    n_channels = array.shape[2]
    if min(array.shape[:2]) < _LEAST_PX or not 0 < n_channels <= _MOST_CHANNELS:
        return None
    if n_channels == 4:  # the fourth channel is alpha, or the channels are four grey frames
        is_stack = is_first and bool((array[:, :, 3] != array[0, 0, 3]).any())
        return array[:, :, 3:] if is_stack else array[:, :, :3]
    return array[:, :, -3:] if n_channels % 3 == 0 else array[:, :, -1:]


def _as_bytes(array: NDArray[Any], space: Any) -> Pixels | None:
    """Return the picture's numbers as bytes; None if the value of white is unknown."""
    bounds = _bounds_of(space)
    if array.dtype == np.uint8 and bounds != (0.0, 1.0):
        return array
    numbers = np.nan_to_num(array.astype(np.float32))
    least, most = float(numbers.min()), float(numbers.max())
    if bounds is None or least < bounds[0] - 0.01 or most > bounds[1] + 0.01:
        bounds = _usual_bounds(least, most, array.dtype)
    elif bounds == (0.0, 255.0) and most <= 1.0 and (numbers % 1.0).any():
        bounds = (0.0, 1.0)  # the space declares bytes, but the values are fractions
    if bounds is None:
        return None
    black, white = bounds
    numbers = np.clip((numbers - black) * (255.0 / (white - black)), 0.0, 255.0)
    return np.asarray(np.rint(numbers), np.uint8)


def _bounds_of(space: Any) -> tuple[float, float] | None:
    low, high = getattr(space, "low", None), getattr(space, "high", None)
    if low is None or high is None or not np.size(low):
        return None
    black, white = float(np.min(low)), float(np.max(high))
    return (black, white) if -_LARGEST <= black < white <= _LARGEST else None


def _usual_bounds(least: float, most: float, dtype: np.dtype[Any]) -> tuple[float, float] | None:
    usual = [(0.0, 1.0), (-1.0, 1.0), (0.0, 255.0)]
    if dtype == np.uint16:
        usual.append((0.0, _LARGEST))
    return next((one for one in usual if one[0] <= least and most <= one[1]), None)
