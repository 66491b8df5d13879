"""Keeps a camera open. Written for Python 3.5."""

from typing import Optional

from robot.bodies.v4l2.device import CaptureError, Video, VideoFrame
from robot.devkit.freshness import REOPEN_S, Freshness
from robot.devkit.usb_camera import SameCamera, SeveralCamerasError


class CameraReader:
    """Opens and watches a camera, and opens it again after a loss."""

    def __init__(self, device: str, width: int, height: int, rate: int, encoding: str) -> None:
        self.same = SameCamera(device)
        self._wanted = (width, height, rate, encoding)
        self._freshness = Freshness(0.0)
        self._next_try_s = 0.0
        self.video = None  # type: Optional[Video]
        self.fault = None  # type: Optional[str]

    def poll(self, now_s: float) -> Optional[VideoFrame]:
        """Return a new picture if the camera has one, or else None. If the camera fails, `fault`
        says why. Never blocks, never raises."""
        if self.video is None and now_s >= self._next_try_s:
            self._reopen(now_s)
        if self.video is None:
            return None
        try:
            frame = self.video.read()
        except OSError as error:
            self._lose("was unplugged ({})".format(error.strerror), now_s)
            return None
        if frame is not None and self._freshness.is_new(frame.data, now_s):
            self.fault = None
            return frame
        wrong = self._freshness.fault(now_s)
        if wrong is not None:
            self._lose(wrong, now_s)
        return None

    def _reopen(self, now_s: float) -> None:
        self._next_try_s = now_s + REOPEN_S
        try:
            path = self.same.find()
            if path is None:
                self.fault = (
                    "The camera {} is unplugged, and no other camera replaces it; plug it into the "
                    "same socket again.".format(self.same.device)
                )
                return
            self.video = Video(path, *self._wanted)
            self.same.opened(self.video.path)
        except (CaptureError, SeveralCamerasError) as error:
            self.fault = self.fault or "Camera: {}".format(error)
        else:
            before, self._freshness = self._freshness, Freshness(now_s)
            self._freshness.continue_from(before)

    def _lose(self, what: str, now_s: float) -> None:
        path = self.video.path if self.video else self.same.device
        self.fault = "The camera {} {}; check its cable. Trying again.".format(path, what)
        self.close()
        self.same.lost()
        self._next_try_s = now_s + REOPEN_S

    def close(self) -> None:
        if self.video is not None:
            self.video.close()
            self.video = None
