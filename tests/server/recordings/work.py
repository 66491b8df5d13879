"""Work for a separate process, which imports only this small module, so that it starts quickly."""

import os
import threading
from collections.abc import Callable

from robot.errors import NotFoundError


class _LocalError(Exception):
    def __init__(self, one: str, other: str) -> None:
        super().__init__(f"{one} {other}")  # this error cannot be unpickled


def work(tell: Callable[[object], None], ending: str) -> None:
    print("a learner may print")
    tell(b"x" * 3_000_000)
    tell(os.nice(0) if hasattr(os, "nice") else 19)
    if ending == "own error":
        raise NotFoundError("no such picture")
    if ending == "foreign error":
        raise _LocalError("by a", "learner")
    if ending == "crash":
        os._exit(3)


def hang(tell: Callable[[int], None]) -> None:
    tell(os.getpid())
    threading.Event().wait()
