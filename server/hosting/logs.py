"""Writes a log with one line for each event: `time level logger event key=value ...`."""

from __future__ import annotations

import atexit
import contextlib
import logging
import sys
import threading
import time
from collections import OrderedDict
from logging.handlers import QueueHandler
from queue import SimpleQueue
from typing import Any, TextIO

_MOST, _WINDOW_S = 5, 60.0
_KINDS = 256
"""Number of kinds of lines that `RepeatFilter` remembers."""
_END_S = 1.0
"""At exit, how long the program waits for the terminal to read the last lines, in seconds."""


class OneLine(logging.Formatter):
    """Puts each log record on one line, so that no client's text can look like another line."""

    converter = staticmethod(time.gmtime)
    default_msec_format = "%s.%03d"

    def format(self, record: logging.LogRecord) -> str:
        """Return the record on one line, its traceback included."""
        return super().format(record).replace("\r", "\\r").replace("\n", "\\n")


class RepeatFilter(logging.Filter):
    """Passes a few lines of each kind per minute, and logs how many more it has dropped.

    Lines are of one kind if their logger, level and message template are equal. Without this
    filter, any client could fill the robot's disk, because each refused request is logged.
    """

    def __init__(self) -> None:
        super().__init__()
        self._seen: OrderedDict[tuple[str, int, str], tuple[float, int]] = OrderedDict()

    def filter(self, record: logging.LogRecord) -> bool:
        """Return False for a line over the limit; see `logging.Filter`."""
        if record.levelno < logging.WARNING:
            return True
        kind = (record.name, record.levelno, str(record.msg)[:80])
        began_s, count = self._seen.pop(kind, (record.created, 0))
        left_out = 0
        if not 0 <= record.created - began_s < _WINDOW_S:
            left_out, began_s, count = max(0, count - _MOST), record.created, 0
        self._seen[kind] = (began_s, count + 1)
        while len(self._seen) > _KINDS:
            self._seen.popitem(last=False)
        if left_out:
            record.msg = f"{record.msg} (and {left_out} more like it)"
        return count < _MOST


def start_logging(*, verbose: bool) -> None:
    """Start to log to standard error; standard output is for the user.

    A separate thread writes the lines, so that a paused terminal (Ctrl+S) or a full pipe does not
    block the other threads, and hardly delays the program's end.
    """
    records: SimpleQueue[Any] = SimpleQueue()
    handler = QueueHandler(records)
    handler.setFormatter(OneLine("%(asctime)sZ %(levelname)s %(name)s %(message)s"))
    handler.addFilter(RepeatFilter())
    writer = threading.Thread(target=_write, args=[records, sys.stderr], daemon=True)
    writer.start()

    def end() -> None:
        records.put(None)
        writer.join(_END_S)
        if writer.is_alive():
            sys.stderr = None  # otherwise Python would wait for it at exit

    atexit.register(end)
    logging.basicConfig(level=logging.DEBUG if verbose else logging.INFO, handlers=[handler])
    for noisy in ("asyncio", "zeroconf", "websockets", "uvicorn"):
        logging.getLogger(noisy).setLevel(logging.WARNING)


def _write(records: SimpleQueue[Any], out: TextIO) -> None:
    while (record := records.get()) is not None:
        with contextlib.suppress(OSError, ValueError):  # standard error may be closed
            print(record.msg, file=out, flush=True)
