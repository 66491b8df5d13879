"""The Raspberry Pi's camera over a stand-in for its library, in virtual time."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import pytest

from robot.bodies.picamera2.camera import Picamera2Camera, Picamera2Options
from robot.errors import CameraError, ConfigurationError
from robot.policy.image import to_rgb
from robot.testing import VirtualClock
from tests.standins import picamera2


class StillPicamera2(picamera2.Picamera2):
    """Gives a picture whenever a test requests one."""

    def start(self) -> None:
        pass

    def stop(self) -> None:
        pass


LIBRARY = SimpleNamespace(Picamera2=StillPicamera2)


def made(**options: object) -> Picamera2Camera:
    return Picamera2Camera(Picamera2Options(**options), VirtualClock(), LIBRARY)


def test_pictures_have_the_right_colours_size_and_time() -> None:
    camera = made(width=64, height=48)
    camera.clock.sleep(5.0)
    with camera:
        camera._take(picamera2.Request(9, (64, 48)))
        frame = camera.latest()
    assert frame is not None and (frame.width, frame.height) == (64, 48)
    assert to_rgb(frame)[24, 32].tolist() == [63, 0, 0], "red is red"
    age_s = camera.clock.now_s() - frame.captured_s
    assert age_s > 0.0199, "as old as the sensor says: 20 ms, in numbers that are rounded"


def test_upside_down_turns_pictures_and_a_repeated_picture_counts_once() -> None:
    with made(width=64, height=48, upside_down=True) as camera:
        for _ in range(2):
            camera._take(picamera2.Request(9, (64, 48)))
        frame = camera.latest()
    assert frame is not None and frame.frame_id == 1
    assert to_rgb(frame)[-1].min() == 255 and to_rgb(frame)[0].max() == 63


def test_a_missing_or_used_camera_is_reported_in_a_sentence(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with pytest.raises(CameraError, match=r"no camera module 1 \(1 found\)"):
        made(camera_number=1).start()
    with made(), pytest.raises(CameraError, match="another program"):
        made().start()
    monkeypatch.setitem(sys.modules, "picamera2", None)
    with pytest.raises(CameraError, match=r"apt install python3-picamera2.*--system-site-packages"):
        Picamera2Camera(Picamera2Options(), VirtualClock()).start()


@pytest.mark.parametrize(
    ("option", "value"), [("width", 3), ("height", 9999), ("frame_rate", 0), ("camera_number", -1)]
)
def test_bad_options_are_refused_with_their_name(option: str, value: int) -> None:
    with pytest.raises(ConfigurationError, match="--" + option.replace("_", "-")):
        Picamera2Options(**{option: value})
