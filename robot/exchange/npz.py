"""The `.npz` recordings of the evaluation as drives."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from robot.exchange.drive import Drive, Shot
from robot.exchange.pictures import read_picture
from robot.recordings import Recording, load_recording


def read_npz(path: Path) -> Drive:
    """Read a recording of frames and labels; raises RecordingError as `load_recording` does."""
    recording = load_recording(path)
    return Drive(name=path.stem, source="npz", shots=_shots(recording))


def _shots(recording: Recording) -> Iterator[Shot]:
    first_s = float(recording.t_s[0])
    for index, (data, label) in enumerate(zip(recording.frames, recording.labels, strict=True)):
        picture = read_picture(data, f"frame {index} of {recording.path}")
        yield Shot(t_s=float(recording.t_s[index]) - first_s, picture=picture, label=label)
