"""Tubs of donkeycar, as the program writes them; their pictures are noise, different for each."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np

Record = dict[str, Any]


@cache
def jpeg(seed: int, height: int = 120, width: int = 160) -> bytes:
    pixels = np.random.default_rng(seed).integers(0, 256, (height // 8, width // 8, 3), np.uint8)
    return cv2.imencode(".jpg", pixels.repeat(8, axis=0).repeat(8, axis=1))[1].tobytes()


def _write_pictures(folder: Path, records: list[Record]) -> None:
    folder.mkdir(parents=True)
    for number, record in enumerate(records):
        name = f"{number}_cam_image_array_.jpg"
        (folder / name).write_bytes(jpeg(number))
        record.setdefault("cam/image_array", name)


def tub_1(folder: Path, records: list[Record]) -> Path:
    """Write a tub of version 1, with a record each 50 ms."""
    _write_pictures(folder, records)
    for number, record in enumerate(records):
        text = json.dumps({"milliseconds": 50 * number, **record})
        (folder / f"record_{number}.json").write_text(text)
    (folder / "meta.json").write_text("{}")
    return folder


def tub_2(folder: Path, records: list[Record], deleted: tuple[int, ...] = ()) -> Path:
    """Write a tub of version 2, with a record each 100 ms and ten in a catalog."""
    _write_pictures(folder / "images", records)
    for index, record in enumerate(records):
        record.update(
            {"_index": index} | {"_timestamp_ms": 1_600_000_000_000 + 100 * index} | record
        )
    paths = [f"catalog_{number}.catalog" for number in range((len(records) + 9) // 10)]
    for number, name in enumerate(paths):
        text = "".join(json.dumps(r) + "\n" for r in records[10 * number : 10 * number + 10])
        (folder / name).write_text(text)
    catalogs = {"paths": paths, "current_index": len(records), "max_len": 10}
    catalogs["deleted_indexes"] = list(deleted)
    lines = [["cam/image_array"], ["image_array"], {}, {"created_at": 1.6e9}, catalogs]
    (folder / "manifest.json").write_text("".join(json.dumps(line) + "\n" for line in lines))
    return folder
