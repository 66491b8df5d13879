from __future__ import annotations

import asyncio
import random
import re
from dataclasses import replace
from typing import Any

import httpx
import pytest

from robot.testing import VirtualClock
from robot.types import Frame
from server.clients.video import Encoder, VideoHub, Viewer
from server.integrations.extension import IntegrationsExtension
from server.integrations.mjpeg import frames_of
from server.integrations.unread import Room
from server.protocol import encode_acknowledgement, parse_picture
from tests.kit.frames import jpeg_frame
from tests.server.virtual import ServedWorld, in_virtual_time, virtually
from tests.server.virtual_server import VirtualServer, connect

BROWSER = {"accept": "image/avif,image/webp,image/*,*/*;q=0.8"}


def test_a_player_gets_the_length_of_each_picture(server: VirtualServer) -> None:
    """Otherwise players based on FFmpeg show pictures two to three periods late."""
    head = re.compile(rb"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: (\d+)\r\n\r\n")
    received = b""
    with httpx.Client() as client, client.stream("GET", server.address + "/video.mjpg") as answer:
        for n, chunk in enumerate(answer.iter_raw()):
            received += chunk
            if n == 4:
                break
    for _ in range(5):
        found = head.match(received)
        assert found is not None, received[:80]
        jpeg, received = received[found.end() :][: int(found[1])], received[found.end() :]
        assert jpeg.startswith(b"\xff\xd8") and jpeg.endswith(b"\xff\xd9")
        received = received[len(jpeg) :].removeprefix(b"\r\n")


@in_virtual_time()
async def test_a_viewer_that_reads_again_gets_only_the_newest_frame(world: ServedWorld) -> None:
    video, unread = world.hub.broadcast.video, [0]
    stream = frames_of(video, world.clock, lambda size: unread[0] <= 1.5 * size)
    world.hub.broadcast.show_newest()
    first = await anext(stream)
    unread[0] = 2 * len(first)
    waiting = asyncio.ensure_future(anext(stream))
    await world.forward(15.0)
    assert not waiting.done()
    unread[0] = 0
    while not waiting.done():
        await world.forward(0.001)
    assert video.newest is not None
    assert waiting.result() == video.encoder.encode_jpeg(video.newest)
    await stream.aclose()


def test_a_stalled_viewer_is_tried_less_and_less_often_and_its_smaller_window_counts() -> None:
    window = [100_000]
    room = Room(lambda: (0, window[0]))
    assert room.is_there(10_000)
    window[0] = 60_000  # the client stalls, and each frame makes its window smaller
    for _ in range(60_000):  # ten minutes
        if room.is_there(10_000):
            window[0] -= 10_000
    assert window[0] == 10_000, "it was tried after 20, 41, 82, 164 and 328 seconds"
    window[0] = 100_000
    assert room.is_there(10_000)
    window[0] = 60_000  # the system offers less, but the client reads all
    assert sum(room.is_there(10_000) for _ in range(10_000)) > 7000


def test_the_bytes_that_vlc_waits_for_come_with_the_picture(server: VirtualServer) -> None:
    """VLC 3 reads 15 KiB from a picture's beginning, then 5 KiB more until it finds the end."""
    vlc = {"user-agent": "VLC/3.0.24 LibVLC/3.0.24", "accept": "*/*"}
    head, waits_for, received, pictures = (
        b"--frame\r\nContent-Type: image/jpeg\r\n\r\n",
        15 * 1024,
        b"",
        0,
    )
    with (
        httpx.Client() as client,
        client.stream("GET", server.address + "/video.mjpg", headers=vlc) as answer,
    ):
        chunks = answer.iter_raw()
        while pictures < 5:
            received += next(chunks)
            if received == head:
                continue
            assert received.startswith(head)
            body = received[len(head) :]
            while body.find(b"--frame", 0, waits_for - 1) < 0:
                waits_for += 5 * 1024
                assert len(body) >= waits_for, "it waits for the next picture"
            jpeg, end = body.split(b"\r\n--frame")[0], body.find(b"--frame")
            assert jpeg.startswith(b"\xff\xd8") and jpeg.rstrip(b"\0").endswith(b"\xff\xd9")
            received, pictures = body[end:], pictures + 1


def test_an_mjpeg_part_is_followed_at_once_by_the_next_header(server: VirtualServer) -> None:
    marker = b"\r\n--frame\r\nContent-Type: image/jpeg\r\n\r\n"
    with (
        httpx.Client() as client,
        client.stream("GET", server.address + "/video.mjpg", headers=BROWSER) as answer,
    ):
        assert answer.headers["content-type"] == "multipart/x-mixed-replace; boundary=frame"
        received, started_s = b"", server.clock.now_s()
        for chunk in answer.iter_raw():
            received += chunk
            if received.count(marker) == 5:
                assert server.hub.broadcast.video.viewers == 1
                break
        assert received.endswith(marker), "a frame never waits for its end"
        assert received.count(b"\xff\xd8") == 5
        assert server.clock.now_s() - started_s < 2
    server.wait_until(
        lambda: server.hub.broadcast.video.viewers == 0, what="the stream ends with its viewer"
    )


def test_an_mjpeg_viewer_of_a_frozen_camera_can_leave(server: VirtualServer) -> None:
    server.camera.is_frozen = True
    with httpx.Client() as client, client.stream("GET", server.address + "/video.mjpg"):
        server.wait_until(lambda: server.hub.broadcast.video.viewers == 1)
    server.wait_until(lambda: server.hub.broadcast.video.viewers == 0)


def test_a_viewer_that_never_acknowledges_gets_one_frame_and_slows_no_other(
    server: VirtualServer,
) -> None:
    with (
        connect(server.ws("/ws/video"), compression=None) as idle,
        connect(server.ws("/ws/video"), compression=None) as busy,
    ):
        parse_picture(idle.recv(5))
        started_s = server.clock.now_s()
        for _ in range(15):
            busy.send(encode_acknowledgement(parse_picture(busy.recv(5)).frame_id))
        assert server.clock.now_s() - started_s < 1.5
        try:
            idle.recv(0.1)
        except TimeoutError:
            return
        raise AssertionError("a second frame was sent before the first was acknowledged")


def test_metrics_tell_of_everything_that_is_promised(server: VirtualServer) -> None:
    with server.pilot() as pilot, connect(server.ws("/ws/video"), compression=None) as video:
        for _ in range(3):
            video.send(encode_acknowledgement(parse_picture(video.recv(5)).frame_id))
        pilot.socket.send("nonsense")
        pilot.wait_for(lambda m: m.get("code") == "malformed")
        httpx.get(server.address, headers={"host": "evil.example"})
        server.wait_until(
            lambda: sum(server.services.extension(IntegrationsExtension).frame_ages.counts) == 3
        )
        server.wait_until(lambda: server.rig.loop.state.cycle_hz > 20)
        text = httpx.get(server.address + "/metrics").text
    values = {
        line.rsplit(" ", 1)[0]: float(line.rsplit(" ", 1)[1])
        for line in text.splitlines()
        if not line.startswith("#")
    }
    assert values["drivelesson_loop_rate_hz"] > 10
    assert values["drivelesson_loop_late_cycles_total"] == 0, "virtual time is never late"
    assert values["drivelesson_frame_age_seconds_count"] == 3
    assert values["drivelesson_pages"] == 1 and values["drivelesson_viewers"] == 1
    assert values['drivelesson_messages_refused_total{code="malformed"}'] == 1
    assert values['drivelesson_requests_refused_total{reason="host"}'] == 1
    assert values['drivelesson_stops_total{reason="pilot_silent"}'] == 0
    assert values['drivelesson_learner_seconds_count{work="propose"}'] > 0


def test_a_stop_is_told_before_the_picture_of_its_moment_is_encoded() -> None:
    async def scenario(world: ServedWorld) -> list[str]:
        await world.pilot(sees=True)
        world.camera.is_frozen = True
        await world.clock.pause(0.5)
        order: list[str] = []
        page = world.connect("/ws/drive", lambda text: None)
        encode, send = world.hub.broadcast.video.encoder.encode, page._down.send

        def note_encoding(frame: Frame) -> Frame:
            order.append("picture")
            return encode(frame)

        def note_sending(message: Any, n_bytes: int) -> None:
            if '"emergency":true' in message.get("text", "").replace(" ", ""):
                order.append("stop")
            send(message, n_bytes)

        world.hub.broadcast.video.encoder.encode = note_encoding  # type: ignore[method-assign]
        page._down.send = note_sending  # type: ignore[method-assign]
        await world.clock.pause(0.5)
        world.loop.latch_emergency()
        world.camera.take()
        await world.until(lambda: len(order) >= 2, what="both are sent")
        return order

    assert virtually(scenario)[:2] == ["stop", "picture"]


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


def test_a_camera_whose_larger_picture_fails_is_shown_small_and_logged_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    def explode(frame: Frame) -> Frame:
        raise ArithmeticError("boom")

    server = VirtualServer()
    server.rig.camera.for_the_eye = explode  # type: ignore[method-assign]
    video, screen = server.services.hub.broadcast.video, _Screen(0.01)
    screen.viewer.size.is_large = True
    video.add(screen.viewer)
    for number in range(1, 4):
        video.show(frame_of(number, server.clock.now_s()))
        video.acknowledge(screen.viewer, number, server.clock.now_s())
    assert len(screen.widths) == 3
    assert [
        one.endswith("failed in for_the_eye: ArithmeticError: boom") for one in caplog.messages
    ] == [True]
