"""In which order each participant meets the conditions: a balanced Latin square. Pure.

Every condition stands equally often at every position, and follows every other equally often.
Source: E. J. Williams, "Experimental designs balanced for the estimation of residual effects of
treatments", Australian Journal of Scientific Research A 2 (1949): one square for an even number of
conditions, a square and its mirror image for an odd one.
"""

from __future__ import annotations


def williams_rows(n: int) -> list[tuple[int, ...]]:
    """Return the rows of the design for `n` conditions, numbered from 0: `n` rows, or 2 `n`."""
    first = [0] + [(k + 1) // 2 if k % 2 else n - k // 2 for k in range(1, n)]
    rows = [tuple((start + i) % n for start in first) for i in range(n)]
    return rows if n % 2 == 0 or n == 1 else rows + [row[::-1] for row in rows]


def order_of(slot: int, n: int, *, is_within: bool = True) -> tuple[int, ...]:
    """Return the conditions of one place in the plan, in their order.

    Args:
        slot: The participant's place, from 0.
        n: How many conditions there are.
        is_within: Every participant meets every condition; else one each, in turn.
    """
    if not is_within:
        return (slot % n,)
    rows = williams_rows(n)
    return rows[slot % len(rows)]
