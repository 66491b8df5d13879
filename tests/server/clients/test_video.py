"""Which pictures the page and players get, when they get them, and in which size."""

import asyncio
import contextlib
import random
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import httpx
import pytest

from robot.testing import LinkConditions, VirtualClock
from robot.types import Frame
from server.clients.video import Encoder, VideoHub, Viewer
from server.integrations.extension import IntegrationsExtension
from server.integrations.mjpeg import frames_of
from server.integrations.unread import Room
from server.protocol import encode_acknowledgement, parse_picture
from tests.kit.frames import jpeg_frame
from tests.server.virtual import in_virtual_time
from tests.server.virtual_server import VirtualServer, connect

BROWSER = {"accept": "image/avif,image/webp,image/*,*/*;q=0.8"}
VLC = {"user-agent": "VLC/3.0.24 LibVLC/3.0.24", "accept": "*/*"}


@contextlib.contextmanager
def player(
    server: VirtualServer, headers: dict[str, str] | None = None
) -> Iterator[httpx.Response]:
    url = server.address + "/video.mjpg"
    with httpx.Client() as client, client.stream("GET", url, headers=headers) as answer:
        yield answer


def test_a_player_gets_the_length_of_each_picture(server):
    """Without a length, players based on FFmpeg show pictures two to three periods late."""
    head = re.compile(rb"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: (\d+)\r\n\r\n")
    with player(server) as answer:
        received = b"".join(chunk for _, chunk in zip(range(5), answer.iter_raw(), strict=False))
    for _ in range(5):
        found = head.match(received)
        assert found is not None, received[:80]
        jpeg, received = received[found.end() :][: int(found[1])], received[found.end() :]
        assert jpeg.startswith(b"\xff\xd8") and jpeg.endswith(b"\xff\xd9")
        received = received[len(jpeg) :].removeprefix(b"\r\n")


def test_the_bytes_that_vlc_waits_for_come_with_the_picture(server):
    """VLC 3 reads 15 KiB from a picture's beginning, then 5 KiB more until it finds the end."""
    head, waits_for = b"--frame\r\nContent-Type: image/jpeg\r\n\r\n", 15 * 1024
    received, pictures = b"", 0
    with player(server, VLC) as answer:
        chunks = answer.iter_raw()
        while pictures < 5:
            received += next(chunks)
            if received == head:
                continue
            assert received.startswith(head)
            body = received[len(head) :]
            while body.find(b"--frame", 0, waits_for - 1) < 0:
                waits_for += 5 * 1024
                assert len(body) >= waits_for, "the player would have to wait for the next picture"
            jpeg, end = body.split(b"\r\n--frame")[0], body.find(b"--frame")
            assert jpeg.startswith(b"\xff\xd8") and jpeg.rstrip(b"\0").endswith(b"\xff\xd9")
            received, pictures = body[end:], pictures + 1


def test_an_mjpeg_part_is_followed_at_once_by_the_next_header(server):
    marker = b"\r\n--frame\r\nContent-Type: image/jpeg\r\n\r\n"
    with player(server, BROWSER) as answer:
        assert answer.headers["content-type"] == "multipart/x-mixed-replace; boundary=frame"
        received, started_s = b"", server.clock.now_s()
        for chunk in answer.iter_raw():
            received += chunk
            if received.count(marker) == 5:
                assert server.hub.broadcast.video.viewers == 1
                break
        assert received.endswith(marker), "a frame is complete without the next one"
        assert received.count(b"\xff\xd8") == 5
        assert server.clock.now_s() - started_s < 2
    server.wait_until(
        lambda: server.hub.broadcast.video.viewers == 0, what="the stream ends with its viewer"
    )


def test_an_mjpeg_viewer_of_a_frozen_camera_can_leave(server):
    server.camera.is_frozen = True
    with player(server):
        server.wait_until(lambda: server.hub.broadcast.video.viewers == 1)
    server.wait_until(lambda: server.hub.broadcast.video.viewers == 0)


@in_virtual_time()
async def test_a_viewer_that_reads_again_gets_only_the_newest_frame(world):
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
    assert waiting.result() == video.encoder.encode_jpeg(video.newest)
    await stream.aclose()


def test_a_stalled_viewer_is_tried_less_and_less_often_and_its_smaller_window_counts():
    window = [100_000]
    room = Room(lambda: (0, window[0]))
    assert room.is_there(10_000)
    window[0] = 60_000  # the client stalls, so each frame makes the window smaller
    for _ in range(60_000):  # ten minutes
        if room.is_there(10_000):
            window[0] -= 10_000
    assert window[0] == 10_000, "a frame was sent after 20, 41, 82, 164 and 328 seconds"
    window[0] = 100_000
    assert room.is_there(10_000)
    window[0] = 60_000  # the system offers a smaller window, but the client reads all
    assert sum(room.is_there(10_000) for _ in range(10_000)) > 7000


def test_a_viewer_gets_each_frame_once_after_its_acknowledgement_and_slows_no_other(server):
    url = server.ws("/ws/video")
    with connect(url, compression=None) as idle, connect(url, compression=None) as busy:
        first = parse_picture(busy.recv(5))
        assert (first.width, first.height) == (160, 120)
        parse_picture(idle.recv(5))
        server.forward(0.2)
        ids, started_s = [first.frame_id], server.clock.now_s()
        for _ in range(15):
            busy.send(encode_acknowledgement(ids[-1]))
            ids.append(parse_picture(busy.recv(5)).frame_id)
        assert server.clock.now_s() - started_s < 1.5
        assert ids == sorted(set(ids)) and ids[1] >= ids[0] + 3, "the newest frame is shown"
        with pytest.raises(TimeoutError):
            idle.recv(0.1)  # the viewer has acknowledged nothing


@in_virtual_time()
async def test_pictures_stay_fresh_on_every_link_and_all_arrive_that_it_can_carry(world):
    ages_s: list[float] = []

    def see(message: str | bytes) -> None:
        picture = parse_picture(message)
        ages_s.append(world.clock.now_s() - picture.captured_s)
        if not picture.quiet:
            socket.send(encode_acknowledgement(picture.frame_id))

    socket = world.connect("/ws/video", see)
    for what, conditions, least, age_s in (
        ("fast", LinkConditions(delay_s=0.005), 290, 0.02),
        ("far", LinkConditions(delay_s=0.05), 270, 0.1),
        ("narrow", LinkConditions(bytes_per_second=62_500), 60, 0.25),
        ("fast again", LinkConditions(delay_s=0.005), 290, 0.02),
    ):
        world.link.conditions = conditions
        await world.forward(10.0)  # meanwhile, the server learns what the link can carry
        ages_s.clear()
        await world.forward(10.0)
        assert len(ages_s) >= least, (what, len(ages_s))
        assert sorted(ages_s)[int(0.95 * len(ages_s))] < age_s, (what, sorted(ages_s)[-20:])


def test_metrics_contain_everything_that_is_promised(server):
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
    assert values["drivelesson_loop_late_cycles_total"] == 0, "in virtual time, no cycle is late"
    assert values["drivelesson_frame_age_seconds_count"] == 3
    assert values["drivelesson_pages"] == 1 and values["drivelesson_viewers"] == 1
    assert values['drivelesson_messages_refused_total{code="malformed"}'] == 1
    assert values['drivelesson_requests_refused_total{reason="host"}'] == 1
    assert values['drivelesson_stops_total{reason="pilot_silent"}'] == 0
    assert values['drivelesson_learner_seconds_count{work="propose"}'] > 0


@in_virtual_time()
async def test_clients_hear_of_a_stop_before_the_picture_of_its_moment_is_encoded(world):
    await world.pilot(sees=True)
    world.camera.is_frozen = True
    await world.clock.pause(0.5)
    order: list[str] = []
    page, video = world.connect("/ws/drive", lambda text: None), world.hub.broadcast.video
    encode, send = video.encoder.encode, page._down.send

    def note_encoding(frame: Frame) -> Frame:
        order.append("picture")
        return encode(frame)

    def note_sending(message: Any, n_bytes: int) -> None:
        if '"emergency":true' in message.get("text", "").replace(" ", ""):
            order.append("stop")
        send(message, n_bytes)

    video.encoder.encode = note_encoding
    page._down.send = note_sending
    await world.clock.pause(0.5)
    world.loop.latch_emergency()
    world.camera.take()
    await world.until(lambda: len(order) >= 2, what="both messages are sent")
    assert order[:2] == ["stop", "picture"]


def frame_of(frame_id: int, at_s: float) -> Frame:
    return jpeg_frame(frame_id, at_s, bytes(3_000))


class _Screen:
    """A viewer that acknowledges each picture after `delay_s`, and notes its width."""

    def __init__(self, delay_s: float) -> None:
        self.delay_s, self.now_s = delay_s, 0.0
        self.widths: list[int] = []
        self.due: list[tuple[float, int]] = []
        self.viewer = Viewer(self._receive)

    def _receive(self, message: bytes) -> None:
        picture = parse_picture(message)
        self.widths.append(picture.width)
        if not picture.quiet:
            self.due.append((self.now_s + self.delay_s, picture.frame_id))


def show(screens: Sequence[_Screen], count: int) -> tuple[VideoHub, list[int]]:
    """Show frames; return the hub, and the ids of the frames of which it wanted larger pictures."""
    clock, wanted = VirtualClock(), list[int]()

    def for_the_eye(frame: Frame) -> Frame:
        wanted.append(frame.frame_id)
        return replace(frame, width=320, height=240, data=bytes(11_000))

    hub = VideoHub(Encoder(75), clock, for_the_eye)
    for screen in screens:
        hub.add(screen.viewer)
    for number in range(1, count + 1):
        clock.advance(1 / 30)
        for screen in screens:
            screen.now_s = clock.now_s()
            while screen.due and screen.due[0][0] <= screen.now_s:
                at_s, frame_id = screen.due.pop(0)
                hub.acknowledge(screen.viewer, frame_id, at_s)
        hub.show(frame_of(number, clock.now_s()))
    return hub, wanted


@pytest.mark.parametrize("seed", range(5))
def test_each_link_gets_the_size_of_picture_that_it_can_carry(seed):
    chance = random.Random(seed)
    easy = [_Screen(chance.uniform(0.001, 0.05)) for _ in range(2)]
    slow = [_Screen(chance.uniform(0.07, 0.3)) for _ in range(2)]
    hub, wanted = show([*easy, *slow], 120)
    for screen in easy:
        assert set(screen.widths[-60:]) == {320}
    for screen in slow:
        assert set(screen.widths) == {160}
    assert hub.frames_encoded <= 2 * 120, "each size is encoded once for all viewers"
    assert len(wanted) == len(set(wanted))


def test_if_all_links_are_slow_no_larger_pictures_are_requested():
    screen = _Screen(0.1)
    assert show([screen], 60)[1] == [] and len(screen.widths) > 10


def test_a_camera_whose_larger_picture_fails_is_shown_small_and_logged_once(caplog):
    def explode(frame: Frame) -> Frame:
        raise ArithmeticError("boom")

    server = VirtualServer()
    server.rig.camera.for_the_eye = explode
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
