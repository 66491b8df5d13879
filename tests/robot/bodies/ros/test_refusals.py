"""Every refusal of a rosbridge becomes an error in rosbridge's own words."""

from __future__ import annotations

import base64
import json
import random

import cv2
import numpy as np
import pytest

from robot.bodies.ros.refusals import REFUSED_S, Refusals, Unwrapping, advice_for
from tests.kit.sizes import crossed

TEXTS = (
    "Topic /cmd_vel already established with type geometry_msgs/msg/TwistStamped",
    "/cmd_vel is not in topics_glob: not allowed",
    "geschlossen – 禁止",
    "x" * 2000,
)
REFUSES = {"error": True, "ERROR": True, "fatal": True, "warning": False, "info": False}
NOISE = ("{", "[]", '"status"', '{"op": 7}', '{"op": "png", "data": "%%"}', "[" * 3000)


def text_as_png(text: str) -> str:
    """Encode a text like rosbridge's png_compression: as pixels, padded with newlines."""
    data = text.encode()
    width = max(1, int((len(data) / 3) ** 0.5))
    height = -(-len(data) // (3 * width))
    pixels = np.frombuffer(data.ljust(3 * width * height, b"\n"), np.uint8)
    picture = pixels.reshape(height, width, 3)[:, :, ::-1]
    return base64.b64encode(cv2.imencode(".png", picture)[1].tobytes()).decode()


def in_fragments(text: str) -> list[str]:
    """Cut a message into seven fragments, in random order."""
    size = -(-len(text) // 7)
    cut = [text[at : at + size] for at in range(0, len(text), size)]
    found = [
        json.dumps({"op": "fragment", "id": "7", "data": data, "num": num, "total": len(cut)})
        for num, data in enumerate(cut)
    ]
    random.Random(1).shuffle(found)
    return found


@crossed(
    text=TEXTS,
    level=REFUSES,
    form=["plain", "fragments", "png", "png in fragments", "after noise"],
)
def test_a_refusal_is_read_in_any_form_and_nothing_else_is_one(
    text: str, level: str, form: str, caplog: pytest.LogCaptureFixture
) -> None:
    status = json.dumps({"op": "status", "level": level, "msg": text, "id": "advertise:/cmd_vel"})
    if "png" in form:
        status = json.dumps({"op": "png", "data": text_as_png(status)})
    sent = in_fragments(status) if "fragments" in form else [status]
    sent = [*NOISE, *sent] if form == "after noise" else sent
    unwrapping, refusals = Unwrapping(), Refusals()
    messages = [message for one in sent for message in unwrapping.messages(one)]
    assert refusals.take(messages[-1], 1.0) is REFUSES[level]
    assert (text[:200] in refusals.at(1.0)) is REFUSES[level]
    assert any(text[:200] in line for line in caplog.messages) is (level == "warning")


def test_a_refusal_counts_for_a_second_and_a_warning_is_written_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    refusals = Refusals()
    warning = {"op": "status", "level": "warning", "msg": "slow"}
    assert not any(refusals.take(warning, 1.0) for _ in range(5))
    assert caplog.messages == ["rosbridge warns: slow"] and not refusals.at(1.0)
    assert refusals.take({"id": "publish:/a", "msg": 7}, 2.0), "without a level it is a refusal"
    assert refusals.at(2.0 + 0.9 * REFUSED_S) == "publish:/a: 7"
    assert not refusals.at(2.0 + REFUSED_S)


def test_the_advice_fits_the_refused_request() -> None:
    for said, is_stamped, has_watchdog, do in (
        (TEXTS[0], False, False, "--stamped true"),
        (TEXTS[0], True, False, "another topic"),
        ("has type geometry_msgs/msg/Twist", True, False, "omit --stamped"),
        ("has type geometry_msgs/msg/Twist", True, True, "watchdog"),
        (TEXTS[1], False, False, "topics_glob"),
        ("no idea", False, False, ""),
    ):
        assert do in advice_for(said, is_stamped=is_stamped, has_watchdog=has_watchdog), said


def test_fragments_that_never_end_are_dropped() -> None:
    unwrapping = Unwrapping()
    for key in range(40):
        part = {"op": "fragment", "id": key, "data": "x" * 2**18, "num": 0, "total": 2}
        assert not list(unwrapping.messages(json.dumps(part)))
    kept = sum(len(data) for parts in unwrapping._parts.values() for data in parts.values())
    assert kept <= 6 * 2**20
    for total in (-1, 0, 10**9, "many", None):
        part = {"op": "fragment", "id": 1, "data": "x", "num": 0, "total": total}
        assert not list(unwrapping.messages(json.dumps(part)))
