"""Runs long work on recordings in a separate process with low priority.

A thread that parses a long recording holds the interpreter's lock for milliseconds at a time, and
an order waits for that lock at each step between the pilot and the motors. With the work in a
separate process, orders take effect as fast as when nobody reads.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Concatenate, ParamSpec, TypeVar

from robot.errors import RecordingError

_P = ParamSpec("_P")
_T = TypeVar("_T")
_NICENESS = 19
_TOLD, _RAISED, _ENDED = range(3)
"""The kinds of messages from the process."""
_BEGIN = "import sys; sys.path[:] = {path!r}; from {module} import main; main()"
"""With `-m`, a folder named `robot` in the working directory would hide the package."""


class SeparateWork(Iterator[_T]):
    """Runs `work(tell, *args, **kwargs)` in a separate process; yields each value that it passes to
    `tell`, and raises what it raises.

    `work` is a function at the top of a module. The separate process also ends with this process.
    If the separate process is killed, RecordingError is raised.
    """

    def __init__(
        self,
        work: Callable[Concatenate[Callable[[_T], None], _P], None],
        *args: _P.args,
        **kwargs: _P.kwargs,
    ) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", _BEGIN.format(path=sys.path, module=__name__)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            creationflags=getattr(subprocess, "IDLE_PRIORITY_CLASS", 0),
        )
        assert self._process.stdin is not None and self._process.stdout is not None
        self._orders, self._results = self._process.stdin, self._process.stdout
        # the process has ended; reading its results raises the error
        with contextlib.suppress(BrokenPipeError):
            self._orders.write(pickle.dumps((work, args, kwargs)))
            self._orders.flush()

    def __next__(self) -> _T:
        try:
            kind, value = pickle.load(self._results)
        except (EOFError, ValueError, pickle.UnpicklingError):
            self.close()
            raise RecordingError(
                "the process that read the recording was ended; is there enough memory?"
            ) from None
        if kind == _TOLD:
            told: _T = value
            return told
        self.close()
        if kind == _RAISED:
            raise value
        raise StopIteration

    def close(self) -> None:
        """Kill the process. Any thread may call this; a `next` that waits on another thread then
        raises."""
        self._process.kill()
        self._process.wait()
        with contextlib.suppress(BrokenPipeError):
            self._orders.close()
        self._results.close()


def main() -> None:
    """Do the work that is described on the standard input, and write its results to the standard
    output."""
    # Ctrl-C ends the server, and the server ends this process
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "nice"):
        os.nice(_NICENESS)
    results = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # a learner may print, which must not disturb the results

    def send(kind: int, value: Any = None) -> None:
        results.write(pickle.dumps((kind, value)))
        results.flush()

    work, args, kwargs = pickle.load(sys.stdin.buffer)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        try:
            work(partial(send, _TOLD), *args, **kwargs)
            send(_ENDED)
        except Exception as error:
            send(_RAISED, _portable(error))
    except BrokenPipeError:
        os._exit(1)  # the other process no longer reads the results


def _end_with_parent() -> None:
    while os.read(0, 1024):  # wait until the other process closes the pipe or ends
        pass
    os._exit(1)


def _portable(error: Exception) -> Exception:
    """Return the error, or an error with its text if it cannot be sent."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(str(error) or type(error).__name__)
    return error
