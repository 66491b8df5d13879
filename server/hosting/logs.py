"""Logs of one line an event: `time level logger event key=value ...`."""

from __future__ import annotations

import logging
import time


class OneLine(logging.Formatter):
    """One line whatever is logged: what a client sent cannot forge a second one."""

    converter = staticmethod(time.gmtime)
    default_msec_format = "%s.%03d"

    def format(self, record: logging.LogRecord) -> str:
        """Return the record on one line, its traceback included."""
        return super().format(record).replace("\r", "\\r").replace("\n", "\\n")


def start_logging(*, verbose: bool) -> None:
    """Log to standard error, which leaves standard output to the person."""
    handler = logging.StreamHandler()
    handler.setFormatter(OneLine("%(asctime)sZ %(levelname)s %(name)s %(message)s"))
    logging.basicConfig(level=logging.DEBUG if verbose else logging.INFO, handlers=[handler])
    for noisy in ("asyncio", "zeroconf", "websockets", "uvicorn"):
        logging.getLogger(noisy).setLevel(logging.WARNING)
