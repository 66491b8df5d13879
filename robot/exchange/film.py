"""Films: pictures to H.264, for a LeRobot dataset or for people."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np

from robot.devices.pictures import MAX_SIDE_PX, Picture
from robot.errors import ConfigurationError, RecordingError, need
from robot.exchange.timeline import make_timeline
from robot.policy.image import Pixels, to_rgb
from robot.store.episodes.editing import EpisodeFrame, moments
from robot.store.episodes.edits import Notes
from robot.store.episodes.episode import Episode
from robot.types import Encoding

_SMALLEST_HEIGHT_PX = 480
_BAR_PX = 56
SUFFIXES = (".mp4", ".mov", ".mkv")
"""How a film's name may end: containers that hold H.264."""
AV = ("av", "writing films", "export")
"""The library, what it is for, and the extra that has it."""


def write_film(
    pictures: Iterable[Pixels],
    path: Path,
    fps: int,
    *,
    crf: int = 18,
    preset: str = "medium",
    key_every: int | None = None,
) -> int:
    """Write pictures of one size, evenly spaced in time; return how many.

    H.264 with 4:2:0 colour, which every player supports; it needs even sides, so an odd last row or
    column is left out. A key frame each second, or every so many pictures, makes seeking fast.

    Raises:
        MissingExtraError: If `av` is not installed.
    """
    av = need(*AV)
    count, stream = 0, None
    options = {"movflags": "faststart"}
    path.parent.mkdir(parents=True, exist_ok=True)
    with av.open(str(path), "w", options=options) as container:
        for picture in pictures:
            even = picture[: picture.shape[0] // 2 * 2, : picture.shape[1] // 2 * 2]
            if stream is None:
                stream = container.add_stream(
                    "libx264", rate=fps, options={"crf": str(crf), "preset": preset}
                )
                stream.height, stream.width = even.shape[:2]
                stream.pix_fmt = "yuv420p"
                stream.codec_context.gop_size = key_every or fps
                stream.codec_context.max_b_frames = 0
            elif even.shape[:2] != (stream.height, stream.width):
                raise RecordingError("the pictures of a film must all have one size")
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(even), format="rgb24")
            frame.pts, frame.time_base = count, Fraction(1, fps)
            container.mux(stream.encode(frame))
            count += 1
        if stream is not None:
            container.mux(stream.encode())
    return count


def to_jpeg(pixels: Pixels) -> Picture:
    """Encode pixels, shape (height, width, 3), at a quality at which nobody sees a difference.

    Raises:
        RecordingError: If they are larger than 4096 pixels a side.
    """
    import cv2

    height, width = pixels.shape[:2]
    if max(height, width) > MAX_SIDE_PX:
        raise RecordingError(f"a picture of {width}x{height} pixels is too large")
    done, data = cv2.imencode(".jpg", pixels[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 95])
    assert done
    return Picture(encoding=Encoding.JPEG, width=width, height=height, data=data.tobytes())


class FilmReader:
    """Gives the pictures of a film by their times, best one after the other.

    Args:
        path: The film.
        fps: Its pictures a second, which say how near a picture must be.
    """

    def __init__(self, path: Path, fps: float) -> None:
        self._path, self._fps = path, fps
        self._frames: Iterator[Any] = iter(())
        self._next: Any = None
        self._asked_s = math.inf

    def at(self, t_s: float) -> Picture:
        """Return the picture at this time, as a JPEG.

        Raises:
            RecordingError: If the film has none there, or is damaged.
            MissingExtraError: If `av` is not installed.
        """
        if t_s < self._asked_s:  # back, or for the first time
            self._frames = self._decode()
            self._next = next(self._frames, None)
        self._asked_s = t_s
        while self._next is not None and self._next.time < t_s - 0.5 / self._fps:
            self._next = next(self._frames, None)
        if self._next is None or self._next.time > t_s + 0.5 / self._fps:
            raise RecordingError(f"the film has no picture at {t_s:.2f} s")
        return to_jpeg(self._next.to_ndarray(format="rgb24"))

    def _decode(self) -> Iterator[Any]:
        """Yield frames as far as they can be decoded."""
        av = need(*AV)
        try:
            with av.open(str(self._path)) as container:
                for frame in container.decode(video=0):
                    if frame.time is not None:
                        yield frame
        except (av.error.FFmpegError, IndexError, ValueError):  # cut, or none
            return


def check_suffix(path: Path) -> None:
    """Refuse a name without a supported suffix.

    Raises:
        ConfigurationError: If the suffix is not supported; lists those that are.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise ConfigurationError(
            f"a film's name must end in {' or '.join(SUFFIXES)}, not in {path.suffix!r}: {path}"
        )


def write_look(
    episode: Episode,
    notes: Notes,
    path: Path,
    *,
    fps: int | None = None,
    on_frame: Callable[[], None] = lambda: None,
) -> int:
    """Write an episode as a film to look at: large, with label and prediction below the picture.

    It lasts as long as the drive without what was deleted. Where the camera gave no picture for a
    moment, the last one stays; longer gaps are cut. Returns how many pictures the film has.

    Raises:
        MissingExtraError: If `av` or OpenCV is not installed.
    """
    kept, times_s = _shown(moments(episode, notes))
    rate = fps or frame_rate(times_s)

    def pictures() -> Iterable[Pixels]:
        for moment, count in zip(kept, repeats(times_s, rate), strict=True):
            on_frame()
            if count:
                picture = _caption(to_rgb(episode.frame(moment.frame_id)), moment)
                for _ in range(count):
                    yield picture

    return write_film(pictures(), path, rate, crf=23, preset="ultrafast")


def _shown(found: list[EpisodeFrame]) -> tuple[list[EpisodeFrame], list[float]]:
    """Return what was not deleted, with times that skip the deleted stretches and the gaps."""
    shown_s = make_timeline([moment.at_s for moment in found]).shown_s
    kept = [pair for pair in zip(found, shown_s, strict=True) if not pair[0].is_deleted]
    times_s = [0.0, *accumulate(for_s for _, for_s in kept)][: len(kept)]
    return [moment for moment, _ in kept], times_s


def repeats(times_s: Sequence[float], rate: int) -> list[int]:
    """Return how often each picture stands in a film of this rate, so that it lasts as long.

    The last picture stays as long as pictures usually do.
    """
    if not times_s:
        return []
    starts = [round((at_s - times_s[0]) * rate) for at_s in times_s]
    usual_s = 1.0 / frame_rate(list(times_s))
    ends = [*starts[1:], max(round((times_s[-1] - times_s[0] + usual_s) * rate), starts[-1] + 1)]
    return [end - start for start, end in zip(starts, ends, strict=True)]


def frame_rate(times_s: list[float]) -> int:
    """Return the usual rate of these times in whole pictures a second, 1 to 60."""
    gaps_s = np.diff(np.asarray(times_s)) if len(times_s) > 1 else np.array([1 / 20])
    usual_s = float(np.median(gaps_s))
    return int(np.clip(round(1 / usual_s), 1, 60)) if usual_s > 0 else 30


def _caption(picture: Pixels, moment: EpisodeFrame) -> Pixels:
    """Enlarge the picture, and write the label and the prediction below it."""
    import cv2

    scale = max(1, -(-_SMALLEST_HEIGHT_PX // picture.shape[0]))
    large = picture.repeat(scale, axis=0).repeat(scale, axis=1)
    bar: Pixels = np.full((_BAR_PX, large.shape[1], 3), 24, np.uint8)
    sure = "" if moment.confidence is None else f" {moment.confidence:.0%}"
    texts = (
        f"{moment.at_s:6.1f} s  pilot: {moment.label or '-'}",
        f"robot: {moment.predicted or '-'}{sure}   drives: {moment.driven_by or '-'}",
    )
    font, light = cv2.FONT_HERSHEY_SIMPLEX, (235, 235, 235)
    for row, text in enumerate(texts):
        cv2.putText(bar, text, (10, 22 + 24 * row), font, 0.6, light, 1, cv2.LINE_AA)
    return np.vstack((large, bar))
