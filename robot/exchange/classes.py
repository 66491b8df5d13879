"""Reads pictures that are labelled by their folders (classes), or by the steering in their file
names.

Pictures that are labelled by folders or file names have no times. Sources: huggingface/datasets,
folder_based_builder; the collision avoidance of NVIDIA-AI-IOT/jetbot; Teachable Machine's exports.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path

from robot.errors import RecordingError
from robot.exchange.drive import Drive, FrameEvent, ImportReport, drive_of
from robot.exchange.files import (
    PICTURES,
    by_number,
    files_ending,
    folders_in,
    parse,
    read_picture_file,
    read_text,
)
from robot.exchange.reading import Reading
from robot.exchange.steering import read_meant
from robot.types import Action

_SEPARATOR = "-!-"
"""Separator of class and number in the names of pictures in a Teachable Machine project."""
_STEERED_NAME = re.compile(r"(\d{6})([-_+]?)([-+]?\d?\.\d+|[-+]?[01])(?:\(\d+\))?")
_POINT_NAME = re.compile(r"(?:xy_)?\d+_\d+_[0-9a-f]{8}(?:-[0-9a-f]+)+")
"""Picture names of JetBot's road following and of JetRacer. They contain a point in the picture,
and a random number."""
_OTHER_PICTURES = (".heic", ".heif", ".avif", ".webp", ".bmp", ".gif", ".tif", ".tiff", ".ppm")
Classes = Mapping[str, list[Path]]


def class_folders(folder: Path) -> Classes:
    """Return the subfolders that contain pictures, with their pictures."""
    found = {each.name: files_ending(each, *PICTURES) for each in folders_in(folder)}
    return {name: by_number(paths) for name, paths in found.items() if paths}


def are_classes(folder: Path) -> bool:
    """True if at least two subfolders contain pictures, or if the only subfolder with pictures has
    the name of a move."""
    if any(files_ending(folder, *PICTURES)):
        return False
    classes = class_folders(folder)
    is_steered = any(_steered_names(paths) for paths in classes.values())
    is_move = any(Reading().move(name) for name in classes)
    return not is_steered and (is_move or len(classes) > 1)


def read_classes(folder: Path, reading: Reading, report: ImportReport) -> Drive:
    """Read a folder with a subfolder of pictures for each class. A class is named after a move, or
    `--moves` assigns it to one."""
    others = [p.name for each in folders_in(folder) for p in files_ending(each, *_OTHER_PICTURES)]
    if others:
        kinds = sorted({Path(name).suffix.lower() for name in others})
        report.skip(f"{len(others)} files", f"neither JPEG nor PNG ({', '.join(kinds)})")
    deeper = sum(
        len(files_ending(p, *PICTURES)) for each in folders_in(folder) for p in _below(each)
    )
    report.remark(f"left out: {deeper} pictures in subfolders of classes" if deeper else None)
    return _read(folder, class_folders(folder), "folders of moves", reading, report)


def _below(folder: Path) -> Iterator[Path]:
    for each in folders_in(folder):
        yield each
        yield from _below(each)


def read_class(folder: Path, reading: Reading, report: ImportReport) -> Drive:
    """Read a folder whose pictures all have the same label: the move after which the folder is
    named, or to which its name is mapped."""
    paths = by_number(files_ending(folder, *PICTURES))
    return _read(folder, {folder.name: paths}, "folder of a move", reading, report)


def is_project(folder: Path) -> bool:
    """True if the folder is an unpacked Teachable Machine project."""
    manifest = folder / "manifest.json"
    if not manifest.is_file():
        return False
    about = parse(read_text(manifest))
    return isinstance(about, dict) and "appdata" in about


def read_project(folder: Path, reading: Reading, report: ImportReport) -> Drive:
    """Read the samples of a Teachable Machine project."""
    classes: dict[str, list[Path]] = {}
    for path in by_number(files_ending(folder, *PICTURES)):
        name, sign, _ = path.name.rpartition(_SEPARATOR)
        if sign:
            classes.setdefault(name, []).append(path)
    if not classes:
        raise RecordingError(
            f"{folder} is a project of Teachable Machine that contains no pictures; only image "
            "projects can be imported"
        )
    return _read(folder, classes, "Teachable Machine project", reading, report)


def _read(
    folder: Path, classes: Classes, source: str, reading: Reading, report: ImportReport
) -> Drive:
    moves = {name: reading.move(name) for name in classes}
    unknown = [name for name, move in moves.items() if move is None]
    of_points = [p.stem for name in unknown for p in classes[name] if _POINT_NAME.fullmatch(p.stem)]
    if of_points:
        raise RecordingError(
            f"the picture names in {folder} contain a target point, as in {of_points[0]}, but no "
            "steering; import a table that lists the pictures with their steering"
        )
    if unknown:
        told = ", ".join(f"{name[:40]} ({len(classes[name])} pictures)" for name in unknown[:8])
        asked = ",".join(f"{name[:40]}=MOVE" for name in unknown[:3])
        raise RecordingError(
            f"{folder} has classes whose names are not moves: {told}; assign each class to a move "
            f'with --moves "{asked}" (use stop for pictures without a move)'
        )

    def read(place: str, of: tuple[Path, Action | None]) -> FrameEvent:
        path, move = of
        label = None if move is Action.STOP else move
        name = path.relative_to(folder).as_posix()
        return FrameEvent(
            place=place, t_s=None, label=label, picture=partial(read_picture_file, folder, name)
        )

    found = (
        (path.relative_to(folder).as_posix(), (path, moves[name]))
        for name, paths in classes.items()
        for path in paths
    )
    return drive_of(
        found, read, f"{folder} has no pictures", name=folder.name, source=source, report=report
    )


def are_steered(folder: Path) -> bool:
    """True if the folder contains pictures whose names consist of six digits and the steering."""
    return bool(_steered_names(files_ending(folder, *PICTURES)))


def _steered_names(paths: Iterable[Path]) -> list[tuple[Path, re.Match[str]]]:
    """Return the pictures whose names contain the steering, if most pictures have such names."""
    paths = list(paths)
    found = [(path, _STEERED_NAME.fullmatch(path.stem)) for path in paths]
    named = [(path, match) for path, match in found if match]
    has_fraction = any("." in match[3] for _, match in named)
    return named if has_fraction and 2 * len(named) > len(paths) else []


def read_steered(folder: Path, reading: Reading, report: ImportReport) -> Drive:
    """Read pictures whose names contain a number and the steering.

    The dash before the steering may be a minus sign or only a separator. Raises RecordingError if
    the names do not show whether the dash is a minus sign.
    """
    paths = files_ending(folder, *PICTURES)
    named = _steered_names(paths)
    for path in {*paths}.difference(path for path, _ in named):
        report.skip(path.name, "the name does not consist of a number and the steering")
    is_divider = _divides(folder, [match for _, match in named])
    numbers = [int(match[1]) for _, match in named]
    if twice := len(numbers) - len(set(numbers)):
        report.remark(
            f"{twice} picture numbers are repeated, so this folder mixes the pictures of several "
            "runs"
        )

    def read(place: str, of: tuple[Path, re.Match[str]]) -> FrameEvent:
        path, match = of
        angle = match[3] if is_divider else match[2].replace("_", "") + match[3]
        label, _ = read_meant([angle], reading, ["the steering in its name"])
        return FrameEvent(
            place=place,
            t_s=None,
            label=label,
            steering=float(angle),
            picture=partial(read_picture_file, folder, path.name),
        )

    ordered = sorted(named, key=lambda found: (int(found[1][1]), found[0].name))
    return drive_of(
        ((path.name, (path, match)) for path, match in ordered),
        read,
        f"{folder} has no pictures",
        name=folder.name,
        source="steering in names",
        report=report,
    )


def _divides(folder: Path, names: list[re.Match[str]]) -> bool:
    """Return True if the dash between the number and the steering only separates them, False if it
    is a minus sign."""
    if any(match[2] and match[3][0] in "+-" for match in names) or any(
        match[2] == "_" for match in names
    ):
        return True
    if any(match[2] in ("", "+") for match in names) or not any(match[2] for match in names):
        return False
    if all(float(match[3]) == 0 for match in names):
        return True
    raise RecordingError(
        f"in {folder} every picture's name has a dash before the steering, as in "
        f"{names[0].string}; the dash may be a minus sign or a separator, so the direction is "
        "unknown; import a table that lists the pictures with their steering"
    )
