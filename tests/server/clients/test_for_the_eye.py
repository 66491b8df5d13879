"""Only viewers whose link has spare bandwidth get the larger picture for people."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest

from robot.testing import VirtualClock
from robot.types import Frame
from server.clients.video import Encoder, VideoHub, Viewer
from server.protocol import parse_picture
from tests.kit.frames import jpeg_frame

SMALL, LARGE = 3_000, 11_000


def frame_of(frame_id: int, at_s: float) -> Frame:
    return jpeg_frame(frame_id, at_s, bytes(SMALL))


def enlarge(frame: Frame) -> Frame:
    return replace(frame, width=320, height=240, data=bytes(LARGE))


class _Screen:
    """A viewer that acknowledges after `delay_s`, and notes the width of each picture."""

    def __init__(self, delay_s: float) -> None:
        self.delay_s = delay_s
        self.widths: list[int] = []
        self.due: list[tuple[float, int]] = []
        self.now_s = 0.0
        self.viewer = Viewer(self._receive)

    def _receive(self, message: bytes) -> None:
        picture = parse_picture(message)
        self.widths.append(picture.width)
        if not picture.quiet:
            self.due.append((self.now_s + self.delay_s, picture.frame_id))


@pytest.mark.parametrize("seed", range(5))
def test_each_link_gets_the_size_of_picture_that_it_can_carry(seed: int) -> None:
    chance = random.Random(seed)
    clock = VirtualClock()
    asked: list[int] = []

    def for_the_eye(frame: Frame) -> Frame:
        asked.append(frame.frame_id)
        return enlarge(frame)

    hub = VideoHub(Encoder(75), clock, for_the_eye)
    easy = [_Screen(chance.uniform(0.001, 0.05)) for _ in range(2)]
    slow = [_Screen(chance.uniform(0.07, 0.3)) for _ in range(2)]
    for screen in easy + slow:
        hub.add(screen.viewer)
    for number in range(1, 121):
        clock.advance(1 / 30)
        now_s = clock.now_s()
        for screen in easy + slow:
            screen.now_s = now_s
            while screen.due and screen.due[0][0] <= now_s:
                hub.acknowledge(screen.viewer, screen.due[0][1], screen.due.pop(0)[0])
        hub.show(frame_of(number, now_s))
    for screen in easy:
        assert set(screen.widths[-60:]) == {320}
    for screen in slow:
        assert set(screen.widths) == {160}
    assert hub.frames_encoded <= 2 * 120, "each size is encoded once for all"
    assert max(asked.count(number) for number in set(asked)) == 1


def test_if_all_links_are_slow_no_larger_pictures_are_requested() -> None:
    clock = VirtualClock()

    def for_the_eye(frame: Frame) -> Frame:
        raise AssertionError("nobody shows it")

    hub = VideoHub(Encoder(75), clock, for_the_eye)
    screen = _Screen(0.1)
    hub.add(screen.viewer)
    for number in range(1, 60):
        clock.advance(1 / 30)
        screen.now_s = clock.now_s()
        while screen.due and screen.due[0][0] <= screen.now_s:
            hub.acknowledge(screen.viewer, screen.due[0][1], screen.due.pop(0)[0])
        hub.show(frame_of(number, screen.now_s))
    assert len(screen.widths) > 10
