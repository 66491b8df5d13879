"""Writes a folder of pictures with a CSV table, which any program can read."""

from __future__ import annotations

import csv
import json
from pathlib import Path

from robot.exchange.files import write_picture
from robot.exchange.steering import done_at
from robot.moves import describe
from robot.recordings.editing import moments
from robot.recordings.edits import Notes
from robot.recordings.episode import Episode
from robot.recordings.moves import to_text

TABLE, MOVES, RESULTS = "frames.csv", "moves.json", "results.json"
METADATA = "metadata.csv"
"""The file from which Hugging Face's `imagefolder` reads the labels."""
COLUMNS = (
    *("file", "frame", "time_s", "label", "angle", "throttle", "degrees"),
    *("predicted", "confidence", "driven_by", "sent", "correction"),
)


def write_folder(episode: Episode, notes: Notes, folder: Path) -> int:
    """Write an episode as a folder of pictures with a table `frames.csv`; return the number of
    pictures.

    `metadata.csv` repeats the labels under the column names of Hugging Face's `imagefolder`.
    `moves.json` contains the moves that the driver declared, so that an import recognises their
    names. `results.json` contains the results of extensions, if there are any.
    """
    folder.mkdir(parents=True)
    declared = describe(episode.moves, episode.declared_moves)
    (folder / MOVES).write_text(to_text(declared), encoding="utf-8")
    if episode.results:
        (folder / RESULTS).write_text(json.dumps(episode.results, indent=1), encoding="utf-8")
    rows = 0
    with (
        (folder / TABLE).open("x", encoding="utf-8", newline="") as file,
        (folder / METADATA).open("x", encoding="utf-8", newline="") as brief,
    ):
        table, metadata = csv.writer(file), csv.writer(brief)
        table.writerow(COLUMNS)
        metadata.writerow(("file_name", "label"))
        for moment in moments(episode, notes):
            if moment.is_deleted:
                continue
            frame = episode.frame(moment.frame_id)
            point = done_at(moment, episode.declared_moves)[1] if moment.label else None
            name = write_picture(frame, folder / "images", f"{moment.frame_id:08d}")
            table.writerow(
                (
                    f"images/{name}",
                    moment.frame_id,
                    f"{moment.at_s:.6f}",
                    moment.label or "",
                    *(point or ("", "")),
                    "" if moment.point is None else "yes",
                    moment.predicted or "",
                    "" if moment.confidence is None else f"{moment.confidence:.4f}",
                    moment.driven_by or "",
                    moment.sent or "",
                    "yes" if moment.is_intervention else "",
                )
            )
            metadata.writerow((f"images/{name}", moment.label or ""))
            rows += 1
    return rows
