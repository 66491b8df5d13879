"""The MJPEG camera: its parser on bytes, and the camera on a server that misbehaves."""

from __future__ import annotations

import threading
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.bodies.mjpeg.camera import MAX_PART_BYTES, MjpegCamera, MjpegOptions, Parts
from robot.clock import RealClock
from robot.errors import CameraError, ConfigurationError
from tests.contract.real_parts import check_camera_on_its_real_line
from tests.standins.mjpeg import MjpegServer

JPEGS = st.binary(max_size=300).map(lambda body: b"\xff\xd8" + body.replace(b"--frame", b""))
SIZES = st.lists(st.integers(1, 50), min_size=1)


def stream(pictures: list[bytes], *, with_length: bool) -> bytes:
    out = b""
    for picture in pictures:
        length = b"Content-Length: %d\r\n" % len(picture) if with_length else b""
        out += b"--frame\r\nContent-Type: image/jpeg\r\n" + length + b"\r\n" + picture + b"\r\n"
    return out + b"--frame"


@given(st.lists(JPEGS, max_size=6), SIZES, st.booleans())
def test_however_the_stream_is_cut_the_pictures_come_whole(
    pictures: list[bytes], sizes: list[int], with_length: bool
) -> None:
    if not with_length:  # then the last line break belongs to the stream, not the picture
        pictures = [picture.rstrip(b"\r\n") for picture in pictures]
    parts, data, found, at = Parts(b"frame"), stream(pictures, with_length=with_length), [], 0
    for turn in range(len(data) + 1):
        size = sizes[turn % len(sizes)]
        found += parts.feed(data[at : at + size])
        at += size
    assert found == pictures
    assert not parts.has_begun


@given(st.binary(max_size=2000))
def test_rubbish_is_no_picture_and_no_crash(data: bytes) -> None:
    assert all(picture.startswith(b"\xff\xd8") for picture in Parts(b"frame").feed(data))


def test_a_picture_without_end_is_refused() -> None:
    parts = Parts(b"frame")
    head = b"--frame\r\nContent-Length: 999999999\r\n\r\n"
    with pytest.raises(CameraError):
        parts.feed(head + b"\xff\xd8")
    parts = Parts(b"frame")
    parts.feed(b"--frame\r\n\r\n\xff\xd8")
    with pytest.raises(CameraError):
        parts.feed(bytes(MAX_PART_BYTES))


def camera(source: str) -> MjpegCamera:
    return MjpegCamera(MjpegOptions(source=source), RealClock())


@pytest.mark.parametrize("source", ["", "0", "film.avi", "rtsp://a/b", "http://", "ftp://a"])
def test_what_is_no_address_is_refused_at_once(source: str) -> None:
    with pytest.raises(ConfigurationError, match="--source"):
        camera(source)


@pytest.mark.realtime
def test_a_stream_over_a_real_line() -> None:
    check_camera_on_its_real_line("mjpeg")
    what_is_no_stream_is_said()
    for with_length in (True, False):
        a_lost_stream_is_a_fault_and_comes_back(with_length)


def what_is_no_stream_is_said() -> None:
    with MjpegServer() as server:
        with pytest.raises(CameraError, match="text/html"):
            camera(server.address.replace("/stream", "/")).start()
        server.refuses = True
        with pytest.raises(CameraError, match="404"):
            camera(server.address).start()
    with pytest.raises(CameraError, match="does not answer"):
        camera(server.address).start()


def wait_until(camera: MjpegCamera, is_so: Callable[[], object]) -> None:
    told = threading.Event()
    camera.listen(told.set)
    for _ in range(400):
        if is_so():
            camera.listen(None)
            return
        told.wait(0.05)
        told.clear()
    pytest.fail(f"it never came to be so; {camera.fault}")


def a_lost_stream_is_a_fault_and_comes_back(with_length: bool) -> None:
    with (
        MjpegServer(with_length=with_length) as server,
        camera(server.address.replace("//", "//me:p%20w@")) as running,
    ):
        wait_until(running, lambda: running.latest())
        assert server.asked[0] == "Basic bWU6cCB3"
        server.refuses = True
        wait_until(running, lambda: "gives no pictures" in (running.fault or ""))
        server.refuses = False
        wait_until(running, lambda: running.fault is None)
