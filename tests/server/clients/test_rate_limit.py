"""The rate limit of a client's messages allows a burst, and then a steady rate."""

from server.clients.rate_limit import RateLimit


def test_the_rate_limit_allows_a_burst_and_then_a_rate():
    pace = RateLimit(per_second=10, burst=5)
    assert [pace.allows(0.0) for _ in range(6)] == [True] * 5 + [False]
    assert [pace.allows(0.2) for _ in range(3)] == [True, True, False]
    assert not pace.allows(-100.0), "a clock that jumps back allows no extra message"
