"""Several faults at once; and a drive is the same in every run. In virtual time."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from .scenario import Fault, Plan, in_fault_world, outcomes
from .table import FAULTS, LIMIT_S, MODES, PAGE, SEEDS, render, without_figures


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_drive_is_the_same_to_the_last_digit_in_every_run(fault: Fault, mode: str) -> None:
    assert outcomes(fault, mode, range(3)) == outcomes(fault, mode, range(3))


PROMPT = [fault for fault in FAULTS if not fault.counts_from and not fault.counts_from_last_message]
PLANS = st.sampled_from(MODES).flatmap(
    lambda mode: st.builds(
        Plan,
        mode=st.just(mode),
        seed=st.integers(0, 2**32),
        limit_s=st.just(LIMIT_S[mode]),
        faults=st.tuples(
            *[st.tuples(st.sampled_from(PROMPT), st.floats(0.0, 0.3)) for _ in range(3)],
        ),
    )
)


@settings(max_examples=max(SEEDS, 50), deadline=None)
@given(plan=PLANS)
def test_the_robot_stands_in_time_whatever_faults_come_together(plan: Plan) -> None:
    in_fault_world(lambda world: world.live_through_many(plan))


def test_the_page_of_faults_is_up_to_date() -> None:
    assert without_figures(PAGE.read_text()) == without_figures(render({})), "run: make docs"
