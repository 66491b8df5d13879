"""Writes and reads films, for LeRobot datasets and for people."""

from __future__ import annotations

import math
import os
from array import array
from collections.abc import Iterable, Iterator
from fractions import Fraction
from itertools import chain, groupby
from pathlib import Path
from typing import Any

import numpy as np

from robot.devkit.pictures import MAX_SIDE_PX, Picture
from robot.errors import RecordingError, need
from robot.exchange.timeline import make_timeline
from robot.policy.image import Pixels, swap_red_and_blue, to_rgb
from robot.recordings.editing import EpisodeFrame, moments
from robot.recordings.edits import Notes
from robot.recordings.episode import Episode
from robot.types import Encoding, Frame

_SMALLEST_HEIGHT_PX = 480
_BAR_PX = 56
_BAR, _TEXT, _NO_COLOUR = 37, 218, 128
"""Brightness of the bar and of its text, and the colour difference of grey, as H.264 stores them:
black is 16, and white is 235."""
_ONE_THREAD_PX = 160 * 120
"""Number of pixels up to which only one thread encodes pictures. Several threads need a third more
CPU time for pictures that are so small."""
SUFFIXES = (".mp4", ".mov", ".mkv")
"""Suffixes of films: containers that support H.264."""
H264, AV1 = "libx264", "libsvtav1"
"""FFmpeg's names of the encoders for H.264 and AV1."""
AV = ("av", "writing films", "export")
"""Arguments of `need` for the library PyAV: its name, its purpose here, and the extra that installs
it."""


def write_film(
    pictures: Iterable[Pixels],
    path: Path,
    fps: int,
    *,
    crf: int = 18,
    preset: str = "medium",
    key_every: int | None = None,
    codec: str = H264,
) -> int:
    """Write pictures of one size, evenly spaced in time; return their number.

    Colours are stored as 4:2:0, which every player supports. The format 4:2:0 needs an even width
    and height, so an odd last row or column is left out. Key frames make seeking fast; there is one
    each second, or one every `key_every` pictures. Raises RecordingError if there are no pictures,
    if they have different sizes, or if they are less than two pixels wide or high.
    """
    frames = map(_to_frame, pictures)
    options = {"crf": str(crf), "preset": preset}
    return _encode(frames, path, fps, options, key_every=key_every or fps, codec=codec)


def _to_frame(picture: Pixels) -> Any:
    even = picture[: picture.shape[0] // 2 * 2, : picture.shape[1] // 2 * 2]
    if not even.size:
        raise RecordingError("a film needs pictures at least two pixels wide and high")
    return _of_pixels(even)


def _of_pixels(pixels: Pixels) -> Any:
    return need(*AV).VideoFrame.from_numpy_buffer(np.ascontiguousarray(pixels), format="rgb24")


def _encode(
    frames: Iterable[Any],
    path: Path,
    fps: int,
    options: dict[str, str],
    *,
    key_every: int,
    codec: str = H264,
) -> int:
    """Write video frames that all have the same even width and height; return their number."""
    av = need(*AV)
    count, stream = 0, None
    # without this setting the AV1 encoder writes its log to the terminal
    os.environ.setdefault("SVT_LOG", "1")
    path.parent.mkdir(parents=True, exist_ok=True)
    with av.open(str(path), "w", options={"movflags": "faststart"}) as container:
        for frame in frames:
            if stream is None:
                stream = container.add_stream(codec, rate=fps, options=options)
                stream.height, stream.width = frame.height, frame.width
                stream.pix_fmt = "yuv420p"
                stream.codec_context.gop_size = key_every
                stream.codec_context.max_b_frames = 0
                if frame.width * frame.height <= _ONE_THREAD_PX:
                    stream.codec_context.thread_count = 1
            elif (frame.height, frame.width) != (stream.height, stream.width):
                raise RecordingError("the pictures of a film must all have the same size")
            frame.pts, frame.time_base = count, Fraction(1, fps)
            container.mux(stream.encode(frame))
            count += 1
        if stream is None:
            raise RecordingError("there are no pictures to export")
        container.mux(stream.encode())
    return count


def of_size(frame: Frame, size: tuple[int, int]) -> Pixels:
    """Return a frame's pixels, scaled to this width and height. The size may change during a
    recording if the camera is turned or replaced, or if its resolution is changed."""
    pixels = to_rgb(frame)
    if (frame.width, frame.height) == size:
        return pixels
    import cv2

    scaled: Pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    return scaled


def to_jpeg(pixels: Pixels) -> Picture:
    """Encode pixels, shape (height, width, 3), without visible loss. Raises RecordingError if the
    width or height is above 4096 pixels."""
    import cv2

    height, width = pixels.shape[:2]
    if max(height, width) > MAX_SIDE_PX:
        raise RecordingError(f"a picture of {width}x{height} pixels is too large")
    done, data = cv2.imencode(".jpg", swap_red_and_blue(pixels), [cv2.IMWRITE_JPEG_QUALITY, 95])
    assert done
    return Picture(encoding=Encoding.JPEG, width=width, height=height, data=data.tobytes())


class FilmReader:
    """Reads pictures of a film by their times. Reading in ascending order is fastest. A picture is
    found if its time differs by at most a tolerance that depends on `fps`."""

    def __init__(self, path: Path, fps: float) -> None:
        self._path, self._fps = path, fps
        self._frames: Iterator[Any] = iter(())
        self._next: Any = None
        self._asked_s = math.inf

    def at(self, t_s: float) -> Picture:
        """Return the picture at this time as a JPEG; raises RecordingError if there is none."""
        # the wanted time is earlier than at the last call, or this is the first call
        if t_s < self._asked_s:
            self._begin(t_s)
        self._asked_s = t_s
        self._skip_to(t_s)
        if self._next is None or self._next.time > t_s + 0.5 / self._fps:
            raise RecordingError(f"the film has no picture at {t_s:.2f} s")
        return to_jpeg(self._next.to_ndarray(format="rgb24"))

    def _begin(self, t_s: float) -> None:
        """Decode from the last key frame before a time. If the film's index is wrong and leads to a
        key frame after this time, decode from the beginning."""
        for from_s in (t_s, 0.0):
            self._frames = self._decode(from_s)
            self._next = next(self._frames, None)
            if self._next is not None and self._next.time <= t_s + 0.5 / self._fps:
                return

    def _skip_to(self, t_s: float) -> None:
        while self._next is not None and self._next.time < t_s - 0.5 / self._fps:
            self._next = next(self._frames, None)

    def _decode(self, from_s: float) -> Iterator[Any]:
        """Seek to the last key frame before `from_s`, and yield the frames from there on, up to the
        first damage in the film."""
        av = need(*AV)
        try:
            with av.open(str(self._path)) as container:
                if from_s > 0.0:
                    stream = container.streams.video[0]
                    container.seek(int(from_s / stream.time_base), stream=stream)
                for frame in container.decode(video=0):
                    if frame.time is not None:
                        yield frame
        except (av.error.FFmpegError, IndexError, ValueError):
            # the file is truncated, or not a film
            return


def write_look(episode: Episode, notes: Notes, path: Path, *, fps: int | None = None) -> int:
    """Write an episode as a film to watch: enlarged, with the label and the prediction below.

    The film plays at the speed of the drive, without the deleted frames. If the camera paused
    briefly, the nearest picture is repeated; longer gaps are cut. All pictures are scaled to the
    size of the first picture. Returns the number of pictures.
    """
    found = enumerate(moments(episode, notes))
    line = make_timeline(array("d", episode.frames.captured_s - episode.start_s))
    rate = fps or line.fps

    def frames() -> Iterable[Any]:
        size: tuple[int, int] | None = None
        for index, same in groupby(chain.from_iterable(line.evenly(rate))):
            moment = next(moment for place, moment in found if place == index)
            if not moment.is_deleted:
                frame = episode.frame(moment.frame_id)
                size = size or (frame.width, frame.height)
                shown = _captioned(of_size(frame, size), moment)
                for _ in same:
                    yield shown

    options = {"crf": "23", "preset": "ultrafast"}
    return _encode(frames(), path, rate, options, key_every=rate)


def _captioned(picture: Pixels, moment: EpisodeFrame) -> Any:
    """Return a video frame: the picture, enlarged to at least 480 rows, above a bar of text.

    FFmpeg enlarges the picture and converts its colours in one step. The text is grey, so it is
    drawn only in the brightness plane. For small pictures, these two measures save most of the time
    of encoding.
    """
    import cv2

    av = need(*AV)
    scale = max(1, -(-_SMALLEST_HEIGHT_PX // picture.shape[0]))
    height, width = (side * scale // 2 * 2 for side in picture.shape[:2])
    large = _of_pixels(picture).reformat(width, height, "yuv420p", interpolation="POINT")
    shown = av.VideoFrame(width, height + _BAR_PX, "yuv420p")
    planes = _planes(shown)
    for plane, of, blank in zip(
        planes, _planes(large), (_BAR, _NO_COLOUR, _NO_COLOUR), strict=True
    ):
        plane[: len(of)] = of
        plane[len(of) :] = blank
    sure = "" if moment.confidence is None else f" {moment.confidence:.0%}"
    texts = (
        f"{moment.at_s:6.1f} s  pilot: {moment.label or '-'}",
        f"robot: {moment.predicted or '-'}{sure}   drives: {moment.driven_by or '-'}",
    )
    font, bar = cv2.FONT_HERSHEY_SIMPLEX, planes[0][height:]
    for row, text in enumerate(texts):
        cv2.putText(bar, text, (10, 22 + 24 * row), font, 0.6, _TEXT, 1, cv2.LINE_AA)
    return shown


def _planes(frame: Any) -> list[Pixels]:
    """Return the brightness and the two colour differences of a video frame, shape (rows,
    columns), as arrays that share the frame's memory."""
    return [
        np.frombuffer(plane, np.uint8).reshape(-1, plane.line_size)[:, : plane.width]
        for plane in frame.planes
    ]
