"""Print each measure of a study by condition, and the differences within participants.

    python describe.py walk.zip

It needs only Python, and reads the complete phases in the zip's `phases.csv`. Adapt it, or read the
table with another program; docs/reference/study.md describes the columns.
"""

import csv
import io
import statistics
import sys
import zipfile
from collections import defaultdict

NO_MEASURES = {"participant", "slot", "condition", "position", "phase", "attempt", "is_complete"}


def main(path: str) -> None:
    with zipfile.ZipFile(path) as archive:
        text = archive.read("phases.csv").decode("utf-8-sig")
    values = defaultdict(lambda: defaultdict(dict))
    for row in csv.DictReader(io.StringIO(text)):
        for name, value in row.items():
            if row["is_complete"] == "1" and name not in NO_MEASURES and is_number(value):
                measure = f"{row['phase']}: {name}"
                values[measure][row["condition"]][row["participant"]] = float(value)
    for measure, by_condition in values.items():
        for condition, by_person in by_condition.items():
            print(f"{measure:40} {condition:16} {describe(list(by_person.values()))}")
        if len(by_condition) == 2:
            (first, a), (second, b) = by_condition.items()
            within = [b[person] - a[person] for person in a.keys() & b.keys()]
            if within:
                print(f"{measure:40} {second} - {first}: {describe(within)}")


def is_number(value: str) -> bool:
    try:
        float(value)
    except ValueError:
        return False
    return True


def describe(values: list[float]) -> str:
    spread = statistics.stdev(values) if len(values) > 1 else 0.0
    return f"n={len(values)} mean={statistics.fmean(values):.4g} sd={spread:.4g}"


if __name__ == "__main__":
    main(sys.argv[1])
