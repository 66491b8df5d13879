"""How many frames are in flight, and how large they are. test_video.py tests whole links."""

from itertools import count

import pytest

from server.clients.flow_control import PictureSize, VideoWindow
from server.protocol import ProtocolError


def test_large_frames_go_out_alone_so_that_sending_never_waits():
    window = VideoWindow()
    window.size = 4
    window.sent(1, 40_000, 0.0)
    assert not window.may_send(20_001)
    assert window.may_send(20_000)


def test_an_acknowledgement_covers_earlier_frames_and_works_once():
    window = VideoWindow()
    window.sent(1, 10, 0.0)
    window.sent(2, 10, 0.0)
    window.acknowledged(2, 0.1)
    assert not window._flight
    for frame_id in (1, 2, 99):
        with pytest.raises(ProtocolError, match="not in flight"):
            window.acknowledged(frame_id, 0.2)


SIZE = 5_000
FRAME_IDS = count(1)


def acknowledge(
    window: VideoWindow,
    delay_s: float,
    at_s: float | None = None,
    *,
    skipped: int = 0,
    n_sent: int = 1,
) -> None:
    """Send frames at the same time, skip some that do not fit, and acknowledge the last one.

    Without `at_s` the frames are sent at time 0, so that their delay is exactly `delay_s`.
    """
    at_s = delay_s if at_s is None else at_s
    for _ in range(n_sent):
        newest = next(FRAME_IDS)
        window.sent(newest, SIZE, at_s - delay_s)
    assert not any(window.may_send(SIZE) for _ in range(skipped))
    window.acknowledged(newest, at_s)


def easy_window() -> VideoWindow:
    window = VideoWindow()
    for _ in range(8):
        acknowledge(window, 0.01)
    assert window.is_easy
    return window


@pytest.mark.parametrize(("delay_s", "is_easy"), [(0.024, True), (0.025, False)])
def test_eight_quick_acknowledgements_in_a_row_indicate_a_fast_link(delay_s, is_easy):
    window = VideoWindow()
    for _ in range(7):
        acknowledge(window, delay_s)
    acknowledge(window, 0.03)
    for _ in range(7):
        acknowledge(window, delay_s)
    assert (window.is_easy, window.size) == (False, 1)
    acknowledge(window, delay_s)
    assert (window.is_easy, window.size) == ((True, 4) if is_easy else (False, 1))


def test_a_fast_link_that_proves_slow_is_retried_less_and_less_often():
    window, now_s = easy_window(), 100.0
    acknowledge(window, 0.05)
    assert window.is_easy, "the delay is exactly at the limit"
    for pause_s in (2.0, 8.0, 32.0, 64.0, 64.0):
        acknowledge(window, 0.051, now_s)
        assert (window.is_easy, window.size) == (False, 1)
        now_s += pause_s
        for _ in range(7):
            acknowledge(window, 0.01, now_s - 0.001)
        assert not window.is_easy, "eight fast answers are needed again"
        acknowledge(window, 0.01, now_s - 0.001)
        assert not window.is_easy, "the pause is not over"
        acknowledge(window, 0.01, now_s)
        assert window.is_easy


def test_a_fast_link_must_show_eight_quick_frames_again_after_a_slow_one():
    window = easy_window()
    acknowledge(window, 0.051, 100.0)
    for is_easy in (*(7 * [False]), True):
        acknowledge(window, 0.01, 102.0)
        assert window.is_easy is is_easy


@pytest.mark.parametrize(("size", "quiet"), [(20_000, [True, False]), (20_001, [False, False])])
def test_a_frame_is_quiet_if_two_more_of_its_size_fit(size, quiet):
    window = easy_window()
    assert [window.sent(next(FRAME_IDS), size, 1.0) for _ in range(2)] == quiet


def test_a_frame_larger_than_the_window_goes_out_when_nothing_is_to_be_acknowledged():
    window = VideoWindow()
    assert window.may_send(100_000)
    window = easy_window()
    quiet = [window.sent(frame_id, SIZE, 1.0) for frame_id in (1_001, 1_002, 1_003)]
    assert quiet == [True, True, False]
    assert not window.may_send(100_000)
    window.acknowledged(1_003, 1.01)
    assert window.may_send(100_000)


def test_the_window_grows_by_one_to_four_each_time_that_three_frames_were_skipped():
    window = VideoWindow()
    acknowledge(window, 0.125, 1.0, skipped=2)
    assert window.size == 1
    acknowledge(window, 0.125, 2.0, skipped=1)
    assert window.size == 2
    acknowledge(window, 0.125, 2.49, n_sent=2, skipped=3)
    assert window.size == 2, "the window waits for four delays"
    acknowledge(window, 0.125, 2.5)
    assert window.size == 3
    acknowledge(window, 0.125, 4.0, n_sent=3, skipped=2)
    assert window.size == 3, "three frames must be skipped again"
    acknowledge(window, 0.125, 5.0, n_sent=3, skipped=1)
    assert window.size == 4
    acknowledge(window, 0.125, 6.0, n_sent=4, skipped=3)
    assert window.size == 4


def grown_window(lone_delay_s: float) -> VideoWindow:
    """Return a window of two frames whose earlier frames took `lone_delay_s` each."""
    window = VideoWindow()
    acknowledge(window, lone_delay_s, skipped=3)
    assert window.size == 2
    return window


LONE_S = 0.128
SLOW_S = LONE_S * 1.3 + 0.008
DOUBLED_S = LONE_S * 1.5 + 0.008


@pytest.mark.parametrize(
    ("delays_s", "size"),
    [
        ([SLOW_S, SLOW_S, SLOW_S], 2),
        ([SLOW_S + 1e-6, SLOW_S + 1e-6], 2),
        ([SLOW_S + 1e-6, SLOW_S + 1e-6, SLOW_S + 1e-6], 1),
        ([SLOW_S + 1e-6, SLOW_S + 1e-6, LONE_S, SLOW_S + 1e-6, SLOW_S + 1e-6], 2),
        ([DOUBLED_S, DOUBLED_S], 2),
        ([DOUBLED_S + 1e-6], 1),
    ],
)
def test_a_larger_window_is_given_up_after_three_slow_frames_or_one_very_slow(delays_s, size):
    window = grown_window(LONE_S)
    for delay_s in delays_s:
        acknowledge(window, delay_s, n_sent=2)
    assert window.size == size


def test_a_slow_frame_in_a_window_of_one_does_not_count_as_a_failed_trial():
    window = VideoWindow()
    acknowledge(window, LONE_S)
    acknowledge(window, 3 * LONE_S, skipped=3)
    assert window.size == 2


def allows(window: VideoWindow, delay_s: float) -> bool:
    """Return whether two frames side by side may take this long without closing the window."""
    for _ in range(3):
        acknowledge(window, delay_s, n_sent=2)
    return window.size > 1


@pytest.mark.parametrize(
    ("delays_s", "lone_delay_s"),
    [
        ([0.128], 0.128),
        ([0.128, 0.256], 0.160),  # the average rises by a quarter of the difference
        ([0.256, 0.128], 0.128),  # the average falls at once
        ([0.128, 0.256, 0.256], 0.184),
    ],
)
def test_a_link_is_judged_only_by_the_delay_of_single_frames(delays_s, lone_delay_s):
    def window() -> VideoWindow:
        new = VideoWindow()
        for delay_s in delays_s[:-1]:
            acknowledge(new, delay_s)
        acknowledge(new, delays_s[-1], skipped=3)
        return new

    limit_s = lone_delay_s * 1.3 + 0.008
    assert allows(window(), limit_s - 1e-6)
    assert not allows(window(), limit_s + 1e-6)


@pytest.mark.parametrize(("n_sent", "lone_delay_s"), [(1, 0.136), (2, 0.128)])
def test_in_a_larger_window_only_a_single_frame_measures_the_link(n_sent, lone_delay_s):
    limit_s = lone_delay_s * 1.3 + 0.008
    for delay_s, is_allowed in ((limit_s - 1e-6, True), (limit_s + 1e-6, False)):
        window = grown_window(0.128)
        acknowledge(window, 0.160, n_sent=n_sent)
        assert allows(window, delay_s) is is_allowed


def note(size: PictureSize, *delays_s: float, now_s: float = 0.0) -> bool:
    for delay_s in delays_s:
        size.note(delay_s, now_s)
    return size.is_large


def test_larger_pictures_come_after_eight_good_acknowledgements_in_a_row():
    size = PictureSize()
    assert not note(size, *(7 * [0.059]), 0.06, *(7 * [0.059])), "0.06 s is not fast enough"
    assert note(size, 0.059)


def test_smaller_pictures_come_after_three_late_acknowledgements_in_a_row():
    size = PictureSize()
    note(size, *(8 * [0.059]))
    assert note(size, 0.121, 0.121, 0.12, 0.121, 0.121), "0.12 s is not too slow"
    assert not note(size, 0.121)


def test_larger_pictures_are_retried_less_and_less_often():
    size, now_s = PictureSize(), 100.0
    note(size, *(8 * [0.01]), now_s=now_s)
    for pause_s in (5.0, 20.0, 80.0, 320.0, 320.0):
        assert not note(size, *(3 * [0.2]), now_s=now_s)
        now_s += pause_s
        assert not note(size, *(8 * [0.01]), now_s=now_s - 0.001), "the pause is not over"
        assert note(size, 0.01, now_s=now_s)


def test_after_each_change_of_the_size_the_row_begins_anew():
    size = PictureSize()
    note(size, *(8 * [0.01]))
    assert note(size, 0.2, 0.2)
    assert not note(size, 0.2, now_s=100.0)
    assert not note(size, *(7 * [0.01]), now_s=105.0)
    assert note(size, 0.01, now_s=105.0)
