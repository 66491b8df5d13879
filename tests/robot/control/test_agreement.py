from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.control.online_learning import WINDOW_S, Agreement


@pytest.mark.parametrize("rate_hz", [3, 10, 30, 100])
def test_it_is_of_the_last_ten_seconds_at_any_rate(rate_hz: int) -> None:
    agreement = Agreement()
    for i in range(40 * rate_hz):
        seconds = i / rate_hz
        agreement.add(seconds, is_right=seconds >= 35.0)
    assert agreement.n_examples == pytest.approx(WINDOW_S * rate_hz, abs=1)
    assert agreement.share == pytest.approx(0.5, abs=0.02)


@given(
    st.lists(
        st.tuples(st.floats(0.0, 3.0), st.booleans(), st.none() | st.floats(0.0, 20.0)), max_size=60
    )
)
def test_what_is_undone_and_what_is_old_no_longer_counts(
    steps: list[tuple[float, bool, float | None]],
) -> None:
    agreement, kept, now_s = Agreement(), list[tuple[float, bool]](), 0.0
    for gap_s, is_right, undone_s in steps:
        now_s += gap_s
        agreement.add(now_s, is_right=is_right)
        kept = [(at_s, right) for at_s, right in kept if at_s > now_s - WINDOW_S]
        kept.append((now_s, is_right))
        if undone_s is not None:
            now_s = max(now_s - undone_s, 0.0)
            agreement.drop_after(now_s)
            kept = [(at_s, right) for at_s, right in kept if at_s <= now_s]
        rights = [right for _, right in kept]
        assert agreement.n_examples == len(kept)
        assert agreement.share == (sum(rights) / len(rights) if rights else None)
