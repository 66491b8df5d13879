"""Reduces YUYV pictures to every n-th pixel, and crops them to the middle. Pure, Python 3.5.

The code uses only slices, because a brick is slow, and the brick's stock image has no numpy.
"""

from typing import NamedTuple

Shrinking = NamedTuple(
    "Shrinking", [("step", int), ("left", int), ("top", int), ("width", int), ("height", int)]
)
"""A plan to reduce a picture: take every `step`-th pixel, beginning at (`left`, `top`), to make a
picture of `width` x `height` pixels."""


def plan_shrinking(width: int, height: int, wanted_width: int, wanted_height: int) -> Shrinking:
    """Return the plan that reduces a picture to nearly the wanted size; a smaller picture is not
    changed.

    Proportions are preserved: an excess in one direction is cropped equally on both sides.
    """
    step = max(1, min(width // wanted_width, height // wanted_height))
    # the width must be even, because two pixels share their colour
    new_width = min(width // step, wanted_width) & ~1
    new_height = min(height // step, wanted_height)
    left = (width - new_width * step) // 2 & ~1
    return Shrinking(step, left, (height - new_height * step) // 2, new_width, new_height)


def shrink_yuyv(data: bytes, stride: int, plan: Shrinking) -> bytes:
    """Return the picture reduced by a plan, without padding at the end of rows.

    Args:
        data: Rows of `stride` bytes, two per pixel: brightness, then colour (U and V alternate).
        stride: Number of bytes from one row to the next.
        plan: The result of `plan_shrinking`.
    """
    size = 2 * plan.width
    begin = 2 * plan.left
    end = begin + size * plan.step
    rows = []
    for y in range(plan.height):
        at = (plan.top + y * plan.step) * stride
        row = data[at + begin : at + end]
        if plan.step > 1:
            small = bytearray(size)
            small[0::4] = row[0 :: 4 * plan.step]
            small[1::4] = row[1 :: 4 * plan.step]
            small[2::4] = row[2 * plan.step :: 4 * plan.step]
            small[3::4] = row[3 :: 4 * plan.step]
            row = bytes(small)
        rows.append(row)
    return b"".join(rows)
