"""What other threads leave for the loop."""

from __future__ import annotations

import threading

import pytest

from robot.control.mailbox import Mailbox
from robot.types import PilotCommand


def command(seq: int) -> PilotCommand:
    return PilotCommand(held=None, frame_id=None, seq=seq, received_s=0.0)


def test_commands_come_in_order_and_once() -> None:
    box = Mailbox()
    for seq in (1, 2, 3):
        box.put_command(command(seq))
    assert box.wake.is_set()
    assert [taken.seq for taken in box.take_commands()] == [1, 2, 3]
    assert box.take_commands() == []


def test_nothing_is_lost_or_doubled_between_threads() -> None:
    box = Mailbox()

    def fill(first: int) -> None:
        for seq in range(first, first + 500):
            box.put_command(command(seq))

    threads = [threading.Thread(target=fill, args=(first,)) for first in (0, 1000, 2000)]
    for thread in threads:
        thread.start()
    taken: list[PilotCommand] = []
    while any(thread.is_alive() for thread in threads):
        taken += box.take_commands()
    taken += box.take_commands()
    assert len({each.seq for each in taken}) == len(taken) == 1500


def test_requests_run_in_order_and_answer_their_asker() -> None:
    box, ran = Mailbox(), []
    first = box.put_request(lambda: ran.append("first"))
    second = box.put_request(lambda: "answer")
    assert not first.done()
    box.serve_requests()
    assert ran == ["first"]
    assert not second.done(), "the turn is not over yet"
    box.answer_requests()
    assert first.done() and second.result(0) == "answer"


def test_a_request_may_leave_another_and_may_fail() -> None:
    box = Mailbox()
    outer = box.put_request(lambda: box.put_request(lambda: 1 // 0))
    box.serve_requests()
    box.answer_requests()
    with pytest.raises(ZeroDivisionError):
        outer.result(0).result(0)


def test_a_request_that_nobody_waits_for_any_more_is_not_run() -> None:
    box, ran = Mailbox(), []
    given_up = box.put_request(lambda: ran.append("given up"))
    assert given_up.cancel()
    other = box.put_request(lambda: ran.append("other"))
    box.serve_requests()
    assert not other.cancel(), "it ran already"
    box.answer_requests()
    assert ran == ["other"] and other.done()
