"""The page gets the curve of agreement, and the reason for the robot's proposed move."""

import sys
import tracemalloc
from base64 import b64decode
from itertools import pairwise

import httpx

from robot.types import Action
from server.coaching.extension import CoachingExtension
from server.coaching.progress import Mark, _Curve


def test_each_mark_of_the_curve_needs_few_bytes():
    marks = [Mark(10 * n, 1 / n, 1e9 + n, "run" if n % 2 else None) for n in range(1, 1001)]
    tracemalloc.start()
    try:
        before, curve = tracemalloc.get_traced_memory()[0], _Curve()
        for mark in marks:
            curve.add(mark)
        assert tracemalloc.get_traced_memory()[0] - before < 60 * len(curve) + sys.getsizeof(curve)
    finally:
        tracemalloc.stop()


def test_the_explanation_shows_the_image_that_decides_now(server):
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


def test_the_curve_grows_with_teaching_shrinks_by_an_undo_and_begins_anew(server):
    progress = server.services.extension(CoachingExtension).progress

    def history():
        server.forward(1.0)
        return httpx.get(f"{server.address}/api/teaching").json()["history"]

    assert history() == [] and progress.mark_of(1) is None
    with server.pilot() as pilot:
        pilot.mode("train")
        pilot.hold("left")
        server.forward(6.0)
    grown = history()
    numbers = [n_examples for n_examples, _ in grown]
    assert len(numbers) > 5 and all(b - a >= 10 for a, b in pairwise([0, *numbers]))
    first, last = progress.mark_of(1), progress.mark_of(numbers[-1])
    assert first is not None and last is not None and first.at_s < last.at_s
    assert first.n_examples == numbers[0] and last.n_examples == numbers[-1]
    assert progress.mark_of(0) is progress.mark_of(numbers[-1] + 1) is None
    undone = httpx.post(f"{server.address}/api/teaching/undo", json={"seconds": 3.0}).json()
    left = history()
    assert undone["undone"] > 0 and 1 < len(left) < len(grown)
    assert left[:-1] == grown[: len(left) - 1] and left[-1][0] < grown[-1][0]
    server.use_policy("published-8")
    assert history() == [] and progress.mark_of(1) is None
