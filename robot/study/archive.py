"""A study's data in one zip file, from which any machine can rebuild the study's table.

The server computes the table with `rebuild` and puts it into the zip. `drivelesson study report`
computes the table again with `rebuild`, and compares it with the table in the zip.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from pathlib import Path

from robot.errors import ConfigurationError, told_as
from robot.study.events import read_events, write_csv, write_events
from robot.study.plan import CODE, parse_plan
from robot.study.rows import columns, condition_logs, rows_of

PLAN, EVENTS, TABLE = "plan.toml", "events/", "phases.csv"
_LARGEST_ZIP_MB = 2000
_OF_MACS = "__MACOSX", ".DS_Store"
_ABOUT = """\
A study made with Drivelesson.

plan.toml    the plan
events/      one event log per session, from which the table is computed
phases.csv   one row per participant and phase

The table can be rebuilt from plan.toml and events/:
drivelesson study report THIS.zip --out FOLDER
The columns are described in docs/reference/study.md of Drivelesson.
"""


def rebuild(plan_text: str, logs: Mapping[str, bytes]) -> dict[str, str]:
    """Return the table's files by path, computed from a plan and the logs by participant.

    Raises ConfigurationError if the plan cannot be read, RecordingError if a log cannot be read.
    """
    plan = parse_plan(plan_text, PLAN)
    found = [log for code in sorted(logs) for log in condition_logs(plan, code, logs[code])]
    rows = [row for log in found for row in rows_of(plan, log)]
    head = columns(plan)
    return {TABLE: write_csv([head, *([row.get(column) for column in head] for row in rows)])}


def pack(plan_text: str, logs: Mapping[str, bytes]) -> bytes:
    """Return the zip: plan, event logs, and the table computed from both."""
    files: dict[str, bytes] = {
        "README.txt": _ABOUT.encode(),
        PLAN: plan_text.encode(),
        **{
            f"{EVENTS}{code}.csv": write_events(read_events(log, code), with_head=True).encode()
            for code, log in sorted(logs.items())
        },
        **{path: text.encode() for path, text in rebuild(plan_text, logs).items()},
    }
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, content in files.items():
            archive.writestr(zipfile.ZipInfo(path, (2000, 1, 1, 0, 0, 0)), content, 8)
    return data.getvalue()


def unpack(path: Path) -> tuple[str, dict[str, bytes], dict[str, bytes]]:
    """Return the zip's plan, its event logs by participant, and its other files by path. Raises
    ConfigurationError if the file is not the zip of a study."""
    wrong = f"{path} cannot be read as a zip"
    # zipfile, zlib and lzma raise different errors
    with told_as(ConfigurationError, wrong, Exception), zipfile.ZipFile(path) as archive:
        entries = [info for info in archive.infolist() if not info.is_dir()]
        if sum(info.file_size for info in entries) > _LARGEST_ZIP_MB * 1_000_000:
            raise ValueError(f"the file unpacks to more than {_LARGEST_ZIP_MB} MB")
        files = _own({info.filename: archive.read(info) for info in entries})
    if PLAN not in files:
        raise ConfigurationError(f"{path} is not a study: it contains no {PLAN}")
    with told_as(ConfigurationError, f"{path}: {PLAN} is not UTF-8", UnicodeDecodeError):
        plan_text = files.pop(PLAN).decode()
    logs = {
        name.removeprefix(EVENTS).removesuffix(".csv"): files.pop(name)
        for name in list(files)
        if name.startswith(EVENTS)
    }
    strange = [code for code in logs if not CODE.fullmatch(code)]
    if strange:
        raise ConfigurationError(
            f"{path}: {EVENTS}{strange[0][:40]} is not named after a participant's code"
        )
    files.pop("README.txt", None)
    return plan_text, logs, files


def _own(files: dict[str, bytes]) -> dict[str, bytes]:
    """Return the study's files from a zip. A Mac's browser unpacks a downloaded zip. If the user
    zips the folder again, all names begin with the folder's name, and the Mac adds its own files:
    `__MACOSX`, `.DS_Store` and `._NAME`."""
    kept = {
        name: data
        for name, data in files.items()
        if not any(part in _OF_MACS or part.startswith("._") for part in name.split("/"))
    }
    folders = {name.partition("/")[0] for name in kept}
    if PLAN in kept or len(folders) != 1:
        return kept
    return {name.partition("/")[2]: data for name, data in kept.items()}


def report(zip_file: Path, out: Path) -> tuple[list[str], list[str]]:
    """Compute a study's table from its zip file, write the table to the folder `out`, and compare
    it with the table in the zip file.

    Returns two lists of paths: the rebuilt files that equal those in the zip file, and the files
    that differ or exist on only one side.
    """
    plan_text, logs, packed = unpack(zip_file)
    made = rebuild(plan_text, logs)
    with told_as(ConfigurationError, f"cannot write to {out}", do="choose another --out"):
        for path, text in made.items():
            (out / path).parent.mkdir(parents=True, exist_ok=True)
            (out / path).write_bytes(text.encode())
    same = [path for path, text in made.items() if packed.get(path) == text.encode()]
    other = sorted({*made, *packed} - set(same))
    return same, other
