"""Things that are started and stopped, and may be used in a `with` block."""

from __future__ import annotations

from abc import ABC, abstractmethod
from types import TracebackType
from typing import Self


class StartStop(ABC):
    """Started on entering a `with` block and stopped on leaving it, whatever happens inside."""

    @abstractmethod
    def start(self) -> None:
        """Begin; idempotent."""

    @abstractmethod
    def stop(self) -> None:
        """End, and let go of everything; idempotent, and safe before `start`."""

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()
