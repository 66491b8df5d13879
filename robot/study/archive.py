"""A study's data in one zip, and its tables and figures, which any machine can rebuild from it.

Nothing is computed elsewhere: the server packs the result of `rebuild`, and
`drivelesson study report` compares its own result with the packed files.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

import numpy as np

from robot.errors import ConfigurationError, told_as
from robot.study import figures
from robot.study.events import read_events, write_csv, write_events
from robot.study.plan import CODE, StudyPlan, parse_plan
from robot.study.profile import THRESHOLDS_M, Profile
from robot.study.rows import ConditionLog, Row, columns, condition_logs, rows_of
from robot.study.table import Table, format_cell
from robot.study.tables import make_tables, measures, values_of
from robot.types import Action, DrivenBy

PLAN, EVENTS = "plan.toml", "events/"
_LARGEST_ZIP_MB = 2000
_ABOUT = """\
A study made with Drivelesson.

plan.toml    the plan
events/      one event log per session: the source of all the rest
phases.csv   one row per participant and phase
tables/      the report's tables, as CSV
figures/     the report's figures, as SVG
report.html  the report

Everything else can be rebuilt from plan.toml and events/:
drivelesson study report THIS.zip --out FOLDER
The columns are described in docs/reference/study.md of Drivelesson.
"""


def rebuild(plan_text: str, logs: Mapping[str, bytes]) -> dict[str, str]:
    """Return every table, figure and the report, by path, from a plan and logs by participant.

    Raises ConfigurationError if the plan cannot be read, RecordingError if a log cannot be read.
    """
    plan = parse_plan(plan_text, PLAN)
    found = [log for code in sorted(logs) for log in condition_logs(plan, code, logs[code])]
    rows = [row for log in found for row in rows_of(plan, log)]
    head, tables = columns(plan), make_tables(plan, rows)
    drawn = _draw(plan, rows, found)
    return {
        "phases.csv": write_csv([head, *([row.get(column) for column in head] for row in rows)]),
        **{f"tables/{name}.csv": write_csv([t.columns, *t.rows]) for name, t in tables.items()},
        **{f"figures/{name}.svg": svg for name, svg in drawn.items()},
        "report.html": _report(plan, len(logs), tables, drawn),
    }


def _draw(plan: StudyPlan, rows: list[Row], logs: list[ConditionLog]) -> dict[str, str]:
    drawn = {}
    for measure in measures(plan):
        columns = {c.name: values_of(rows, c.name, measure) for c in plan.conditions}
        if any(columns.values()):
            name = f"{measure[0]}: {measure[1]}"
            drawn["-".join(measure)] = figures.strips(name, columns, joined=plan.is_within)
    for condition in plan.conditions:
        mine = [log for log in logs if log.condition is condition]
        pilots = [log.profile(DrivenBy.PILOT, "teach") for log in mine]
        robots = [log.profile(DrivenBy.ROBOT, "alone") for log in mine]
        for move in condition.moves:
            both = _mean(pilots, move), _mean(robots, move)
            if any(both):
                name, title = f"{condition.name}-{move}", f"{condition.name}: {move}"
                drawn[f"profile-{name}"] = figures.curves(
                    f"Behavior Profile, {title}", *both, float(THRESHOLDS_M[1])
                )
    return drawn


def _mean(profiles: Sequence[Profile], move: Action) -> list[float]:
    """Return the mean share at each threshold over all who made the move; [] if nobody did."""
    made = [profile[move] for profile in profiles if move in profile]
    return [float(share) for share in np.mean(made, axis=0)] if made else []


def _report(
    plan: StudyPlan, n_sessions: int, tables: Mapping[str, Table], drawn: Mapping[str, str]
) -> str:
    parts = [
        "<!doctype html><html lang='en'><meta charset='utf-8'>",
        "<meta name='viewport' content='width=device-width, initial-scale=1'>",
        f"<title>{escape(plan.title)}</title><style>body{{font:16px/1.5 system-ui,sans-serif;"
        "max-width:75rem;margin:2rem auto;padding:0 1rem}table{border-collapse:collapse;"
        "display:block;overflow-x:auto}td,th{padding:.2rem .6rem;border-bottom:1px solid #ccc;"
        "text-align:left}figure{display:inline-block;margin:.5rem}</style>",
        f"<h1>{escape(plan.title)}</h1>",
        f"<p>{n_sessions} sessions of {plan.participants} planned.</p>",
    ]
    for table in tables.values():
        head = "".join(f"<th scope='col'>{escape(column)}</th>" for column in table.columns)
        parts.append(f"<h2>{escape(table.title)}</h2><table><thead><tr>{head}</tr></thead><tbody>")
        for row in table.rows:
            cells = "".join(f"<td>{escape(format_cell(cell))}</td>" for cell in row)
            parts.append(f"<tr>{cells}</tr>")
        parts.append(f"</tbody></table><p>{escape(table.note)}</p>")
    parts += [f"<figure>{svg}</figure>" for svg in drawn.values()]
    return "\n".join(parts) + "\n"


def pack(plan_text: str, logs: Mapping[str, bytes]) -> bytes:
    """Return the zip: plan, event logs, and the files made from them."""
    files: dict[str, bytes] = {
        "README.txt": _ABOUT.encode(),
        PLAN: plan_text.encode(),
        # Logs are rewritten: in a log of version 0.2 an answer may still be a formula.
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
    """Return the plan, the logs by participant, and the packed tables and figures by path;
    ConfigurationError if the file is not such a zip."""
    wrong = f"{path} cannot be read as a zip"
    # zipfile, zlib and lzma have errors of their own
    with told_as(ConfigurationError, wrong, Exception), zipfile.ZipFile(path) as archive:
        entries = [info for info in archive.infolist() if not info.is_dir()]
        if sum(info.file_size for info in entries) > _LARGEST_ZIP_MB * 1_000_000:
            raise ValueError(f"it unpacks to more than {_LARGEST_ZIP_MB} MB")
        files = {info.filename: archive.read(info) for info in entries}
    if PLAN not in files:
        raise ConfigurationError(f"{path} is not a study: {PLAN} is missing in it")
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
            f"{path}: {EVENTS}{strange[0][:40]} does not have a participant's code as its name"
        )
    files.pop("README.txt", None)
    return plan_text, logs, files


def report(zip_file: Path, out: Path) -> tuple[list[str], list[str]]:
    """Rebuild all tables and figures of a zip in a folder; see `unpack` and `rebuild`.

    Returns the paths that are equal to the packed ones, and those that differ.
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
