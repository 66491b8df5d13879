"""The terminal's log delays no other thread, and no client can forge a line in the log."""

import io
import logging
import sys
import threading

from server.hosting.logs import start_logging


class Terminal(io.StringIO):
    """A stream that records which threads write to it."""

    def __init__(self) -> None:
        super().__init__()
        self.writers: set[str] = set()

    def write(self, text: str) -> int:
        self.writers.add(threading.current_thread().name)
        return super().write(text)


def test_only_the_logs_thread_waits_for_the_terminal_and_a_record_is_one_line(monkeypatch):
    """A paused terminal would hold up the control loop, which logs each stop."""
    terminal, at_exit = Terminal(), []
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(logging.root, "handlers", [])
    monkeypatch.setattr(logging.root, "level", logging.INFO)
    monkeypatch.setattr("atexit.register", at_exit.append)
    start_logging(verbose=False)
    log = logging.getLogger("robot.control")
    for number in range(7):
        log.warning("stop reason=%s", number)
    log.warning("path=%s", "a\nb\rc")
    try:
        raise ValueError("two\nlines")
    except ValueError:
        log.exception("it failed")
    for end in at_exit:
        end()
    assert threading.current_thread().name not in terminal.writers
    lines = terminal.getvalue().splitlines()
    assert len(lines) == 5 + 2, "only five messages of one kind are logged"
    assert " WARNING robot.control stop reason=4" in lines[4]
    assert lines[5].endswith("path=a\\nb\\rc")
    assert "it failed" in lines[6] and "two\\nlines" in lines[6]
