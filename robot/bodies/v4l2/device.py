"""Reads a camera through the kernel's Video4Linux interface, with only ioctl and mmap.

Written for Python 3.5 and the standard library, because the agent on a brick includes it.
"""

import glob
import mmap
import os
import struct
import time
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Tuple

from robot.bodies.v4l2.shrink import plan_shrinking, shrink_yuyv
from robot.devkit.usb_camera import AUTO

try:
    import fcntl
except ImportError:  # On Windows the module can be imported, but no camera can be opened.
    fcntl = None  # type: ignore[assignment]

FMT = struct.Struct("@I0L200s")
PIX = struct.Struct("=IIIIII")
BUFFER = struct.Struct("@5Ill16s2IL3I0L")
CAPTURE, MMAP = 1, 1
FLAG_ERROR, FLAG_MONOTONIC, CLOCK_MASK = 0x40, 0x2000, 0xE000
CAN_CAPTURE, CAN_STREAM, DEVICE_CAPS = 0x1, 0x04000000, 0x80000000
FOURCC = {"yuyv": (b"YUYV",), "jpeg": (b"MJPG", b"JPEG")}
"""The kernel's names of each encoding. JPEG has two names."""
N_BUFFERS = 2

VideoFrame = NamedTuple("VideoFrame", [("data", bytes), ("taken_s", float)])
"""The camera's unchanged bytes, and their time on this machine's monotonic clock."""


def ioctl_number(way: int, number: int, size: int) -> int:
    """Return the kernel's number of a video ioctl; way is 1 (write), 2 (read) or 3 (both)."""
    return way << 30 | size << 16 | ord("V") << 8 | number


QUERYCAP = ioctl_number(2, 0, 104)
ENUM_FMT = ioctl_number(3, 2, 64)
S_FMT = ioctl_number(3, 5, FMT.size)
REQBUFS = ioctl_number(3, 8, 20)
QUERYBUF = ioctl_number(3, 9, BUFFER.size)
QBUF = ioctl_number(3, 15, BUFFER.size)
DQBUF = ioctl_number(3, 17, BUFFER.size)
STREAMON = ioctl_number(1, 18, 4)
STREAMOFF = ioctl_number(1, 19, 4)
S_PARM = ioctl_number(3, 22, 204)
ENUM_FRAMESIZES = ioctl_number(3, 74, 44)
DISCRETE = 1


class CaptureError(Exception):
    """A camera is missing or refuses a request. The message names the camera and the remedy."""


class Video:
    """One streaming camera. A picture can be `read` when its `fileno` is readable."""

    def __init__(self, device: str, width: int, height: int, rate: int, encoding: str) -> None:
        self.path = (list_cameras() or ["/dev/video0"])[0] if device == AUTO else device
        self._fd = self._open_device(self.path)
        self._maps = []  # type: List[mmap.mmap]
        try:
            self._check_abilities()
            self.encoding, self._code = self._choose_encoding(encoding)
            self.width, self.height, self._stride = self._set_format(width, height)
            self._shrinking = plan_shrinking(self.width, self.height, width, height)
            self._n_rows = self.height
            if self.encoding == "yuyv":
                self.width, self.height = self._shrinking.width, self._shrinking.height
            self._set_rate(rate)
            self._map_buffers()
            fcntl.ioctl(self._fd, STREAMON, struct.pack("i", CAPTURE))
        except OSError as error:
            self.close()
            raise CaptureError(
                "the camera {} failed: {}; unplug it and plug it in again".format(
                    self.path, error.strerror
                )
            ) from error
        except CaptureError:
            self.close()
            raise

    @staticmethod
    def _open_device(path: str) -> int:
        if fcntl is None:
            raise CaptureError("only Linux can open {}; use --camera opencv".format(path))
        try:
            return os.open(path, os.O_RDWR | os.O_NONBLOCK)
        except OSError as error:
            raise CaptureError(
                "no camera at {} ({}); plug it in, or choose another with --device".format(
                    path, error.strerror
                )
            ) from error

    def _check_abilities(self) -> None:
        data = fcntl.ioctl(self._fd, QUERYCAP, bytes(104))
        abilities, of_device = struct.unpack_from("=II", data, 84)
        if abilities & DEVICE_CAPS:
            abilities = of_device
        if not (abilities & CAN_CAPTURE and abilities & CAN_STREAM):
            raise CaptureError(
                "{} is not a streaming camera; choose another with --device".format(self.path)
            )

    def _choose_encoding(self, wanted: str) -> Tuple[str, bytes]:
        """Return the format to use: YUYV if the camera offers it, because it needs no decoder here
        and the page can show it."""
        offered = _offered_codes(self._fd)
        for name in ("yuyv", "jpeg") if wanted == "auto" else (wanted,):
            for code in FOURCC[name]:
                if code in offered:
                    return name, code
        raise CaptureError(
            "the camera {} does not support {}; it supports: {}".format(
                self.path,
                "YUYV or MJPEG" if wanted == "auto" else wanted,
                ", ".join(code.decode("ascii", "replace") for code in offered) or "nothing",
            )
        )

    def _set_format(self, width: int, height: int) -> Tuple[int, int, int]:
        """Request a size; return the nearest size that the camera has, and its bytes per row."""
        code = struct.unpack("=I", self._code)[0]
        wanted = PIX.pack(width, height, code, 1, 0, 0)
        data = fcntl.ioctl(self._fd, S_FMT, FMT.pack(CAPTURE, wanted))
        width, height, given, _, stride, _ = PIX.unpack_from(FMT.unpack(data)[1])
        if given != code:
            raise CaptureError("the camera {} does not accept the format".format(self.path))
        return width, height, stride

    def _set_rate(self, rate: int) -> None:
        parm = struct.pack("=IIIII", CAPTURE, 0, 0, 1, rate) + bytes(184)
        try:
            fcntl.ioctl(self._fd, S_PARM, parm)
        except OSError:
            pass  # the frame rate of this camera cannot be set

    def _buffer(self, index: int) -> bytearray:
        zeros = bytes(16)
        return bytearray(BUFFER.pack(index, CAPTURE, 0, 0, 0, 0, 0, zeros, 0, MMAP, 0, 0, 0, 0))

    def _map_buffers(self) -> None:
        data = fcntl.ioctl(self._fd, REQBUFS, struct.pack("=5I", N_BUFFERS, CAPTURE, MMAP, 0, 0))
        for index in range(struct.unpack_from("=I", data)[0]):
            buffer = self._buffer(index)
            fcntl.ioctl(self._fd, QUERYBUF, buffer)
            fields = BUFFER.unpack(buffer)
            self._maps.append(
                mmap.mmap(self._fd, fields[11], mmap.MAP_SHARED, offset=fields[10] & 0xFFFFFFFF)
            )
            fcntl.ioctl(self._fd, QBUF, buffer)

    def fileno(self) -> int:
        return self._fd

    def read(self) -> Optional[VideoFrame]:
        """Return the newest waiting picture and drop older ones; None if no picture waits. Raises
        OSError if the camera is gone."""
        newest = None
        while True:
            buffer = self._buffer(0)
            try:
                fcntl.ioctl(self._fd, DQBUF, buffer)
            except BlockingIOError:
                return newest
            fields = BUFFER.unpack(buffer)
            if not fields[3] & FLAG_ERROR:
                newest = self._take(fields) or newest
            fcntl.ioctl(self._fd, QBUF, buffer)

    def _take(self, fields: Tuple[Any, ...]) -> Optional[VideoFrame]:
        index, used, flags = fields[0], fields[2], fields[3]
        taken_s = fields[5] + fields[6] / 1e6
        if flags & CLOCK_MASK != FLAG_MONOTONIC:
            taken_s = time.monotonic()
        data = self._maps[index][:used]
        if self.encoding == "yuyv":
            if len(data) < self._stride * self._n_rows:
                return None  # the picture is incomplete
            data = shrink_yuyv(data, self._stride, self._shrinking)
        return VideoFrame(data, taken_s) if data else None

    def close(self) -> None:
        """Stop streaming and close the device; idempotent."""
        if self._fd >= 0:
            try:
                fcntl.ioctl(self._fd, STREAMOFF, struct.pack("i", CAPTURE))
            except OSError:
                pass  # the device was unplugged
            for picture in self._maps:
                picture.close()
            os.close(self._fd)
            self._fd = -1


def list_cameras() -> List[str]:
    """Return the existing video devices, by number."""
    ends = [path[len("/dev/video") :] for path in glob.glob("/dev/video*")]
    numbers = sorted(int(end) for end in ends if end.isdigit())
    return ["/dev/video{}".format(number) for number in numbers]


def describe_camera(path: str) -> Dict[str, List[str]]:
    """Return the encodings that the camera offers, such as `YUYV`, each with its sizes."""
    fd = Video._open_device(path)
    try:
        codes = _offered_codes(fd)
        return {code.decode("ascii", "replace"): _offered_sizes(fd, code) for code in codes}
    finally:
        os.close(fd)


def _offered_codes(fd: int) -> List[bytes]:
    return [data[44:48] for data in _offered(fd, ENUM_FMT, struct.pack("=I", CAPTURE) + bytes(56))]


def _offered_sizes(fd: int, code: bytes) -> List[str]:
    found = [
        struct.unpack_from("=III", data, 8)
        for data in _offered(fd, ENUM_FRAMESIZES, code + bytes(36))
    ]
    return ["{}x{}".format(width, height) for kind, width, height in found if kind == DISCRETE]


def _offered(fd: int, request: int, asked: bytes) -> Iterator[bytes]:
    """Yield the entries of one of the camera driver's lists, such as its picture formats. Entries
    are requested by index until the driver refuses one."""
    for index in range(64):
        try:
            yield fcntl.ioctl(fd, request, struct.pack("=I", index) + asked)
        except OSError:
            return
