"""The challenge over HTTP."""

from __future__ import annotations

from typing import Any

import httpx

from tests.server.virtual_server import VirtualServer


def test_a_try_is_armed_and_can_be_given_up(server: VirtualServer) -> None:
    at = f"{server.address}/api/challenge"

    def told() -> dict[str, Any]:
        answer: dict[str, Any] = httpx.get(at).json()
        return answer

    assert not told()["is_armed"] and told()["best_m"] is None
    assert httpx.post(f"{at}/try").json()["is_armed"]
    assert not httpx.delete(f"{at}/try").json()["is_armed"]
    assert told()["tries"] == []
