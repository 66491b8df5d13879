"""What ends the program, and that it ends in order."""

from __future__ import annotations

import signal
import sys


def end_by_signals() -> None:
    """Have SIGTERM, and a terminal that is closed, end the program as Ctrl-C does.

    Newer uvicorns raise a signal again once they have shut down; by the system's own handler the
    process would end before the motors are stopped and the model is saved.
    """
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    for name in ("SIGHUP", "SIGBREAK"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is signal.SIG_DFL:  # no nohup
            signal.signal(number, lambda *_: signal.raise_signal(signal.SIGTERM))
