"""Runs long work on recordings in a separate process with low priority.

A thread that parses a long recording would hold the interpreter's lock for milliseconds at a time.
A pilot's command to the motors would wait for this lock several times. A separate process does not
delay commands.
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
"""The kinds of messages from the separate process: a value, an error, the end of the work."""
_BEGIN = "import sys; sys.path[:] = {path!r}; from {module} import main; main()"
"""The program of the separate process. The program is not started by `-m`, because a folder named
`robot` in the working directory would then hide our package."""


class SeparateWork(Iterator[_T]):
    """Runs `work(tell, *args, **kwargs)` in a separate process, which never outlives this
    process.

    Iterating yields the values that `work` passes to `tell`. If `work` raises an error, iterating
    raises it, too. If the process was killed, iterating raises RecordingError. `work` must be a
    function of a module.
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
        # if the process has already ended, reading its results raises the error
        with contextlib.suppress(BrokenPipeError):
            self._orders.write(pickle.dumps((work, args, kwargs)))
            self._orders.flush()

    def __next__(self) -> _T:
        try:
            kind, value = pickle.load(self._results)
        except (EOFError, ValueError, pickle.UnpicklingError):
            self.close()
            raise RecordingError(
                "the process that read the recording was killed; is there enough memory?"
            ) from None
        if kind == _TOLD:
            told: _T = value
            return told
        self.close()
        if kind == _RAISED:
            raise value
        raise StopIteration

    def close(self) -> None:
        """Kill the process. Any thread may call this; a thread that waits in `next` gets an
        error."""
        self._process.kill()
        self._process.wait()
        with contextlib.suppress(BrokenPipeError):
            self._orders.close()
        self._results.close()


def main() -> None:
    """Read the work from standard input, do it, and write its results to standard output."""
    # ignore Ctrl-C, because the server gets it too and then ends this process
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "nice"):
        os.nice(_NICENESS)
    results = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # a learner's prints must not mix with the results on this pipe

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
        os._exit(1)  # the process that started this one no longer reads the results


def _end_with_parent() -> None:
    while os.read(0, 1024):  # wait until the process that started this one closes the pipe
        pass
    os._exit(1)


def _portable(error: Exception) -> Exception:
    """Return an error that can be pickled: the same error, or else a RuntimeError with its text."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(str(error) or type(error).__name__)
    return error
