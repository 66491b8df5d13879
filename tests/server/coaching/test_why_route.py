"""The explanation of a proposal, requested over HTTP while the robot sees and learns."""

from __future__ import annotations

from base64 import b64decode

import httpx

from robot.types import Action
from tests.server.virtual_server import VirtualServer


def test_the_explanation_shows_the_image_that_decides_now(server: VirtualServer) -> None:
    loop = server.rig.loop
    server.wait_until(lambda: loop.state.frame_id is not None)
    assert httpx.get(f"{server.address}/api/why").json() == {"why": None}

    server.teach(2, (Action.LEFT, Action.FORWARD), every_s=1.0)
    server.wait_until(lambda: getattr(loop.state.prediction, "node", None) is not None)
    why = httpx.get(f"{server.address}/api/why").json()["why"]
    assert why["action"] in ("forward", "left", "right")
    assert sum(why["votes"].values()) == why["frames"] == 1
    assert [len(row) for row in why["alike"]] == [8] * 6
    for name in ("present", "image"):
        assert b64decode(why[name]).startswith(b"\x89PNG")
