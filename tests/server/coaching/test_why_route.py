"""The explanation of a proposal, requested over HTTP while the robot sees and learns."""

from __future__ import annotations

from base64 import b64decode

import httpx

from robot.types import Action, Example
from tests.server.virtual_server import VirtualServer


def test_the_explanation_shows_the_image_that_decides_now(server: VirtualServer) -> None:
    loop = server.rig.loop
    server.wait_until(lambda: loop.state.frame_id is not None)
    assert httpx.get(f"{server.address}/api/why").json() == {"why": None}

    def teach() -> None:
        assert loop.learning.newest is not None
        x, _ = loop.learning.newest
        for number, label in enumerate((Action.LEFT, Action.FORWARD)):
            example = Example(frame_id=number, label=label, is_intervention=False)
            loop.history.teach(example, (x + 40 * number).astype(x.dtype), float(number))

    done = loop.submit(teach)
    server.wait_until(done.done)
    done.result()
    server.wait_until(lambda: getattr(loop.state.prediction, "node", None) is not None)
    why = httpx.get(f"{server.address}/api/why").json()["why"]
    assert why["action"] in ("forward", "left", "right")
    assert sum(why["votes"].values()) == why["frames"] == 1
    assert [len(row) for row in why["alike"]] == [8] * 6
    for name in ("present", "image"):
        assert b64decode(why[name]).startswith(b"\x89PNG")
