"""The MJPEG camera: its parser on bytes, and the camera with a server that misbehaves."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.bodies.mjpeg.answer import MAX_PART_BYTES, PictureFinder
from robot.bodies.mjpeg.camera import MjpegCamera, MjpegOptions
from robot.clock import RealClock
from robot.errors import CameraError, ConfigurationError
from tests.contract.real_parts import check_camera_on_its_real_line
from tests.kit.wait import wait_until
from tests.standins.mjpeg import MjpegServer


@given(st.binary(max_size=2000), st.integers(1, 50))
def test_rubbish_is_no_crash_however_it_is_cut(data: bytes, size: int) -> None:
    rubbish = b"\xff\xd8\xff" + data + b"\xff\xd9"
    whole, finder = PictureFinder().feed(rubbish), PictureFinder()
    found = [p for i in range(0, len(rubbish), size) for p in finder.feed(rubbish[i : i + size])]
    assert found == whole


def test_a_picture_without_end_is_refused() -> None:
    finder = PictureFinder()
    finder.feed(b"--frame\r\n\r\n\xff\xd8\xff\xda\x00\x02")
    with pytest.raises(CameraError, match="4 MB"):
        finder.feed(bytes(MAX_PART_BYTES))


def camera(source: str) -> MjpegCamera:
    return MjpegCamera(MjpegOptions(source=source), RealClock())


@pytest.mark.parametrize(
    "source",
    ["", "0", "film.avi", "rtsp://a/b", "http://", "ftp://a", "http://a:99999/", "http://a..b/"],
)
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


def a_lost_stream_is_a_fault_and_comes_back(with_length: bool) -> None:
    with (
        MjpegServer(with_length=with_length) as server,
        camera(server.address.replace("//", "//me:p%20w@")) as running,
    ):
        wait_until(running.latest)
        assert server.asked[0] == "Basic bWU6cCB3"
        server.refuses = True
        wait_until(lambda: "gives no pictures" in (running.fault or ""))
        server.refuses = False
        wait_until(lambda: running.fault is None)
