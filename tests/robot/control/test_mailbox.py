"""Requests that other threads leave for the loop."""

from __future__ import annotations

import threading
from functools import partial

import pytest

from robot.control.loop import Mailbox


def test_nothing_is_lost_or_doubled_between_threads() -> None:
    box, ran = Mailbox(), []

    def fill(first: int) -> None:
        for number in range(first, first + 500):
            box.put(partial(ran.append, number))

    threads = [threading.Thread(target=fill, args=(first,)) for first in (0, 1000, 2000)]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        box.serve()
    box.serve()
    assert len(set(ran)) == len(ran) == 1500


def test_requests_run_once_in_order_an_urgent_one_first_and_answer_their_asker() -> None:
    box, ran = Mailbox(), []
    first = box.put(lambda: ran.append("first"))
    second = box.put(lambda: "answer")
    box.put(lambda: ran.append("urgent"), is_urgent=True)
    assert box.wake.is_set() and not first.done()
    for _ in range(2):
        box.serve()
        assert ran == ["urgent", "first"]
        assert not second.done(), "the turn is not over yet"
    box.answer()
    assert first.done() and second.result(0) == "answer"


def test_a_request_may_leave_another_and_may_fail() -> None:
    box = Mailbox()
    outer = box.put(lambda: box.put(lambda: 1 // 0))
    box.serve()
    box.answer()
    with pytest.raises(ZeroDivisionError):
        outer.result(0).result(0)


def test_a_request_that_nobody_waits_for_any_more_is_not_run() -> None:
    box, ran = Mailbox(), []
    given_up = box.put(lambda: ran.append("given up"))
    assert given_up.cancel()
    other = box.put(lambda: ran.append("other"))
    box.serve()
    assert not other.cancel(), "it ran already"
    box.answer()
    assert ran == ["other"] and other.done()
