"""Reads the valid records of a donkeycar tub.

Cars may be switched off while they write, and tubs may be copied incompletely. So each record is
read separately, and damaged records are skipped.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from robot.errors import RecordingError
from robot.exchange.drive import ImportReport
from robot.exchange.files import parse, read_text

IMAGE = "cam/image_array"
MOVES, RESULTS = "drivelesson_moves", "drivelesson_results"
"""Keys that a manifest has only if this program wrote it. `MOVES` lists the moves, so that a
damaged label can be recognised. `RESULTS` has the results of extensions."""
_MOST_LINE_CHARS = 2**20
_DECODER = json.JSONDecoder()
Record = dict[str, Any]
Placed = tuple[str, Record]
"""A record of a tub: its location, for the import's report, and its fields."""


def is_tub(folder: Path) -> bool:
    """True if the folder looks like a tub of either version, even an incomplete tub."""
    is_second = (folder / "manifest.json").is_file() or any(folder.glob("[!.]*.catalog"))
    return is_second or any(folder.glob("record_*.json"))


def read_first(folder: Path, report: ImportReport) -> list[Placed]:
    """Return the records of a tub of version 1, sorted by number."""
    numbered = []
    for path in folder.glob("record_*.json"):
        match = re.fullmatch(r"record_(\d{1,12})\.json", path.name)
        if match:
            numbered.append((int(match[1]), path))
    return [
        (path.name, record)
        for _, path in sorted(numbered)
        for record in _records(_text_of(path, report), path.name, report)
    ]


def read_second(folder: Path, report: ImportReport) -> tuple[list[Placed], list[str] | None]:
    """Return the records of a tub of version 2, without the deleted ones. If this program wrote the
    tub, also return the moves that its manifest lists."""
    names, deleted, moves = _read_manifest(folder, report)
    records = []
    for name in names:
        own = own_name(name)
        if Path(own).name != own:
            report.skip(name[:80], "the path leads out of the tub")
            continue
        for number, line in enumerate(_text_of(folder / own, report).split("\n"), start=1):
            if line.strip():
                place = f"{own} line {number}"
                records += [(place, record) for record in _records(line, place, report)]
    kept = [r for i, r in enumerate(records) if str(r[1].get("_index", i)) not in deleted]
    if gone := len(records) - len(kept):
        report.remark(
            f"left out, as they were deleted in the tub: {gone} of {len(records)} records"
        )
    return kept, moves


def _read_manifest(
    folder: Path, report: ImportReport
) -> tuple[list[str], set[str], list[str] | None]:
    """Return the names of the catalogs, the deleted records, and the moves, as far as known.

    If there is no manifest, the names are those of the folder's catalogs, in order.
    """
    path = folder / "manifest.json"
    lines = [parse(line) for line in _text_of(path, report).splitlines() if line.strip()]
    catalogs = lines[4] if len(lines) > 4 and isinstance(lines[4], dict) else {}
    named = catalogs.get("paths")
    if not isinstance(named, list):
        there = (p.name for p in folder.glob("[!.]*.catalog"))
        names = sorted(there, key=lambda name: (int("0" + re.sub(r"[^0-9]", "", name)[:18]), name))
        report.skip(path.name, "it is missing or damaged, so deleted records are imported, too")
        return names, set(), None
    deleted = catalogs.get("deleted_indexes")
    if not isinstance(deleted, list):
        deleted = []
        report.remark("the manifest does not list deleted records, so all records are used")
    moves = lines[2].get(MOVES) if isinstance(lines[2], dict) else None
    is_list = isinstance(moves, list)
    return [str(name) for name in named], set(map(str, deleted)), moves if is_list else None


def _text_of(path: Path, report: ImportReport) -> str:
    """Read a file as text; an unreadable file is skipped."""
    try:
        return read_text(path)
    except RecordingError as error:
        report.skip(path.name, str(error).removeprefix(f"{path} "))
        return ""


def _records(text: str, place: str, report: ImportReport) -> Iterator[Record]:
    """Yield the records of a line: usually one record, or several if a power cut lost a line
    break."""
    left_out, at = "", 0
    while len(text) <= _MOST_LINE_CHARS and (begin := text.find("{", at)) >= 0:
        left_out += text[at:begin]
        try:
            record, at = _DECODER.raw_decode(text, begin)
        except (ValueError, RecursionError):
            left_out, at = "{", begin + 1
            continue
        if isinstance(record.get(IMAGE), str) and record[IMAGE]:
            yield record
        else:
            report.skip(place, f"the record names no picture ({IMAGE})")
    if (left_out + text[at:]).strip() or not text.strip():
        report.skip(place, "the record is damaged or incomplete")


def own_name(name: str) -> str:
    """Return only the last part of an absolute path; return any other name unchanged. A tub
    that was moved still contains its old paths, which may be of another operating system."""
    is_absolute = name.startswith(("/", "\\")) or re.match(r"[A-Za-z]:[\\/]", name)
    return re.split(r"[\\/]", name)[-1] if is_absolute else name
