"""The pilot of `virtual.py`, for a test that is not a coroutine."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Self

from robot.types import Point

from .virtual import Pilot

if TYPE_CHECKING:
    from .virtual_server import VirtualServer


class VirtualPilot:
    """The pilot of `virtual.py`, for a test that is not a coroutine."""

    def __init__(
        self, server: VirtualServer, *, sees: bool = False, headers: dict[str, str] | None = None
    ) -> None:
        self._server = server

        async def begin() -> Pilot:
            return Pilot(server, sees=sees, headers=headers)

        self.page = server.run(begin())
        server.wait_until(lambda: bool(self.page.state.get("frame")), what="the first state")

    def __getattr__(self, name: str) -> Any:
        return getattr(self.page, name)

    @property
    def is_silent(self) -> bool:
        return self.page.is_silent

    @is_silent.setter
    def is_silent(self, is_silent: bool) -> None:
        self.page.is_silent = is_silent

    def hold(self, held: str | None, point: Point | None = None) -> None:
        self._do(self.page.hold, held, point)

    def mode(self, mode: str) -> None:
        self._do(self.page.mode, mode)

    def release(self) -> None:
        self._do(self.page.release)

    def send(self, **message: Any) -> None:
        self._do(self.page.send, **message)

    def close(self) -> None:
        if not self.page.has_ended:
            self._do(self.page.close)

    def vanish(self) -> None:
        self._do(self.page.vanish)

    def _do(self, action: Callable[..., None], *args: Any, **fields: Any) -> None:
        async def act() -> None:
            action(*args, **fields)

        self._server.run(act())

    def wait_for(
        self, wanted: Callable[[dict[str, Any]], bool], within_s: float = 5.0
    ) -> dict[str, Any]:
        return self._server.run(self.page.wait_for(wanted, within_s))

    def wait_for_state(self, within_s: float = 5.0, **fields: Any) -> dict[str, Any]:
        return self._server.run(self.page.wait_for_state(within_s, **fields))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()
