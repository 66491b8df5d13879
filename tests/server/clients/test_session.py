"""Order, pace, credit and the wheel, with time as an argument."""

from __future__ import annotations

import heapq

import pytest

from server.clients.flow_control import Order, VideoWindow
from server.clients.lease import Lease
from server.protocol import ProtocolError
from server.security.pace import Pace


def test_order_must_grow() -> None:
    order = Order()
    order.check(1)
    order.check(7)
    for late in (7, 3):
        with pytest.raises(ProtocolError, match="greater than 7"):
            order.check(late)


def test_pace_allows_a_burst_and_then_a_rate() -> None:
    pace = Pace(per_second=10, burst=5)
    assert [pace.allows(0.0) for _ in range(6)] == [True] * 5 + [False]
    assert [pace.allows(0.2) for _ in range(3)] == [True, True, False]
    assert not pace.allows(-100.0), "a clock that jumps back gives nothing away"


class _Link:
    """A line of so many bytes a second and so long a round trip, and a viewer at its end."""

    def __init__(self, *, bytes_a_second: float, round_trip_s: float, size: int = 5000) -> None:
        self.window = VideoWindow()
        self.rate, self.round_trip_s, self.size = bytes_a_second, round_trip_s, size
        self.ages_s: list[float] = []
        self.sizes: list[int] = []
        self.n_acknowledged = 0
        self._line_free_s = 0.0
        self._arriving: list[tuple[float, int, float, bool]] = []
        self._newest: tuple[int, float] | None = None
        self._sent = 0

    def run(self, seconds: float, rate_hz: float = 30.0, start_s: float = 0.0) -> None:
        for number in range(1, int(seconds * rate_hz)):
            now_s = start_s + number / rate_hz
            while self._arriving and self._arriving[0][0] <= now_s:
                at_s, frame_id, captured_s, is_quiet = heapq.heappop(self._arriving)
                if not is_quiet:
                    self.n_acknowledged += 1
                    self.window.acknowledged(frame_id, at_s)
                self.ages_s.append(at_s - self.round_trip_s / 2 - captured_s)
                self._offer(at_s)
            self._newest = (int(now_s * 1000), now_s)
            self._offer(now_s)
            self.sizes.append(self.window.size)

    def _offer(self, now_s: float) -> None:
        if self._newest is None or self._newest[0] == self._sent:
            return
        if self.window.may_send(self.size):
            self._sent, captured_s = self._newest
            is_quiet = self.window.sent(self._sent, self.size, now_s)
            self._line_free_s = max(self._line_free_s, now_s) + self.size / self.rate
            arrival = (self._line_free_s + self.round_trip_s, self._sent, captured_s, is_quiet)
            heapq.heappush(self._arriving, arrival)


def test_on_an_easy_line_every_frame_arrives_and_each_third_is_acknowledged() -> None:
    link = _Link(bytes_a_second=1e7, round_trip_s=0.01)
    link.run(10)
    assert len(link.ages_s) >= 297
    assert 95 <= link.n_acknowledged <= 115


def test_large_frames_on_an_easy_line_are_never_all_quiet() -> None:
    link = _Link(bytes_a_second=1e8, round_trip_s=0.01, size=45_000)
    link.run(10)
    assert len(link.ages_s) >= 297


@pytest.mark.parametrize("size", [5000, 25_000])
def test_an_easy_line_that_becomes_narrow_is_noticed(size: int) -> None:
    link = _Link(bytes_a_second=1e7, round_trip_s=0.01, size=size)
    link.run(5)
    link.rate = 62_500
    link.ages_s.clear()
    link.run(20, start_s=5)
    assert not link.window.is_easy
    assert max(link.ages_s[5:]) < 4 * size / 62_500


def test_on_a_long_line_the_window_grows_until_every_frame_arrives() -> None:
    link = _Link(bytes_a_second=1e7, round_trip_s=0.1)
    link.run(20)
    assert link.window.size == 4
    assert len(link.ages_s) > 0.9 * 600


@pytest.mark.parametrize(("size", "most_s"), [(5000, 0.25), (25_000, 1.2)])
def test_on_a_narrow_line_the_picture_stays_young(size: int, most_s: float) -> None:
    link = _Link(bytes_a_second=62_500, round_trip_s=0.01, size=size)
    link.run(60)
    ages_s = sorted(link.ages_s)
    assert ages_s[int(0.95 * len(ages_s))] < most_s
    assert sum(n > 1 for n in link.sizes) < 0.15 * len(link.sizes), "it tries seldom"
    first, last = link.ages_s[20:120], link.ages_s[-100:]
    assert sum(last) / len(last) < 1.2 * sum(first) / len(first), "flat over a minute"


def test_a_line_that_becomes_narrow_is_noticed() -> None:
    link = _Link(bytes_a_second=1e7, round_trip_s=0.1)
    link.run(10)
    link.rate = 62_500
    link.ages_s.clear()
    link.run(20, start_s=10)
    assert sorted(link.ages_s[20:])[int(0.9 * len(link.ages_s[20:]))] < 0.35


def test_large_frames_go_out_alone_so_that_sending_never_waits() -> None:
    window = VideoWindow()
    window.size = 4
    window.sent(1, 40_000, 0.0)
    assert not window.may_send(40_000)
    assert window.may_send(10_000)


def test_an_acknowledgement_covers_earlier_frames_and_works_once() -> None:
    window = VideoWindow()
    window.sent(1, 10, 0.0)
    window.sent(2, 10, 0.0)
    window.acknowledged(2, 0.1)
    assert window.in_flight == 0
    for frame_id in (1, 2, 99):
        with pytest.raises(ProtocolError, match="not in flight"):
            window.acknowledged(frame_id, 0.2)


def test_the_wheel_goes_to_the_first_and_then_to_who_asked() -> None:
    lease = Lease(lapse_s=1.5)
    assert lease.join("a", 0.0)
    assert not lease.join("b", 0.1)
    assert not lease.take("b", 0.2)
    assert lease.renew("a", 0.3) and not lease.renew("b", 0.3)
    assert lease.give_up("a", 0.4)
    assert lease.owner == "b"


def test_a_lapsed_wheel_goes_to_who_waits_or_to_who_asks() -> None:
    lease = Lease(lapse_s=1.5)
    lease.join("a", 0.0)
    assert not lease.pass_on_if_lapsed(9.0), "nobody waits"
    lease.renew("a", 9.0)
    lease.take("b", 9.5)
    assert not lease.pass_on_if_lapsed(10.0)
    assert lease.pass_on_if_lapsed(10.6)
    assert lease.owner == "b"
    assert lease.take("c", 20.0), "b has been silent"


def test_who_leaves_while_waiting_is_forgotten() -> None:
    lease = Lease()
    lease.join("a", 0.0)
    lease.take("b", 0.0)
    assert not lease.give_up("b", 0.1)
    assert lease.give_up("a", 0.2)
    assert lease.owner is None


def test_a_lease_lasts_to_its_very_end_and_a_second_and_a_half_by_default() -> None:
    lease = Lease()
    assert lease.join("c1", 10.0)
    assert not lease.take("c2", 11.5), "to the very end it is kept"
    assert not lease.pass_on_if_lapsed(11.5)
    assert lease.pass_on_if_lapsed(11.5 + 1e-6)
    assert lease.owner == "c2"
