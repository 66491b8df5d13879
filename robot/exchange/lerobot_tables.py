"""The parquet tables of a LeRobot dataset."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from robot.errors import RecordingError, need, told_as

Columns = dict[str, NDArray[Any]]
"""Columns of the table of frames: for each feature one value per frame."""
PILOT = "pilot"
"""Name of the column that contains the move that the pilot taught, as its index in the feature's
list of names. The index is -1 if no move was taught."""
DEGREES = "degrees"
"""Name of the column that is true if the pilot steered proportionally, and false if the pilot chose
a move."""
ROBOT = "drivelesson"
"""Type of robot in the datasets of this program, and of its package for LeRobot
(docs/examples/lerobot)."""
PYARROW = ("pyarrow", "reading and writing LeRobot datasets", "export")
"""Arguments of `need` for the library pyarrow: its name, its purpose here, and the extra that
installs it."""
_PARQUET = ("pyarrow.parquet", *PYARROW[1:])
_MOST_TABLE_BYTES = 2**30
_ROWS = 10_000
"""Number of rows that are encoded in memory together."""


def read_table(
    path: Path, columns: list[str] | None = None, episode: int | None = None
) -> list[dict[str, Any]]:
    """Read the rows of one episode or of all episodes, with the `columns` that are present. Raises
    RecordingError if the table is damaged, or unpacks to more than 1 GB."""
    pa, pq = need(*PYARROW), need(*_PARQUET)
    errors = pa.lib.ArrowException, OSError, ValueError, KeyError
    with told_as(RecordingError, f"{path} cannot be read", *errors):
        with pq.ParquetFile(path) as file:
            groups = range(file.metadata.num_row_groups)
            size = sum(file.metadata.row_group(group).total_byte_size for group in groups)
            there = file.schema_arrow.names
        if size > _MOST_TABLE_BYTES:
            raise RecordingError(f"{path} unpacks to more than 1 GB")
        rows = None if episode is None else [("episode_index", "=", episode)]
        chosen = None if columns is None else [name for name in columns if name in there]
        table = pq.read_table(path, columns=chosen, filters=rows, partitioning=None)
        found: list[dict[str, Any]] = table.to_pylist()
    return found


def write_data(folder: Path, columns: Columns) -> None:
    """Write one row per frame."""
    pa = need(*PYARROW)
    arrays = {name: pa.array(values.reshape(-1)) for name, values in columns.items()}
    for name, values in columns.items():
        if values.ndim == 2:
            arrays[name] = pa.FixedSizeListArray.from_arrays(arrays[name], values.shape[1])
    _write_table(pa.table(arrays), folder / "data/chunk-000/file-000.parquet")


def write_episodes(folder: Path, rows: list[dict[str, Any]]) -> None:
    """Write one row per episode."""
    table = need(*PYARROW).Table.from_pylist(rows)
    _write_table(table, folder / "meta/episodes/chunk-000/file-000.parquet")


def write_tasks(folder: Path, task: str) -> None:
    """Write the table of tasks. Its index, in pandas' format, is the column with the tasks'
    texts."""
    pa = need(*PYARROW)
    types = {"task_index": ("int64", "int64"), "task": ("unicode", "object")}
    described = [
        {"name": n, "field_name": n, "pandas_type": of, "numpy_type": plain, "metadata": None}
        for n, (of, plain) in types.items()
    ]
    pandas = {
        "index_columns": ["task"],
        "column_indexes": [],
        "columns": described,
        "creator": {"library": "pyarrow", "version": pa.__version__},
        "pandas_version": "2.0.0",
    }
    table = pa.table({"task_index": pa.array([0], pa.int64()), "task": pa.array([task])})
    table = table.replace_schema_metadata({"pandas": json.dumps(pandas)})
    _write_table(table, folder / "meta/tasks.parquet")


def _write_table(table: Any, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    need(*_PARQUET).write_table(table, path, compression="snappy", row_group_size=_ROWS)
