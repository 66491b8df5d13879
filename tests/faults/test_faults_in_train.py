"""Each fault while the pilot teaches: the robot stops, reports why, and stays stopped.

In virtual time. There is one file for each mode, so that several processes can share the table.
"""

from __future__ import annotations

import pytest

from .scenario import Fault
from .table import BY, FAULTS, check


@BY
@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_the_robot_stands_in_time_whenever_a_fault_comes(fault: Fault, by: str) -> None:
    check(fault, "train", by)
