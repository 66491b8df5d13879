"""Removes deleted items from the trash after some days.

The age of an item is not the difference between now and the time of its deletion. A Raspberry Pi or
an EV3 without a battery for its clock starts in the past, and sets its clock when it finds a
network. An item that was deleted before would then seem decades old. Instead, a file adds up the
times between checks, and each of these times counts as a week at most.
"""

from __future__ import annotations

import contextlib
import json
import shutil

from robot.errors import UNREADABLE
from robot.store.folder import Storage, write_whole
from robot.store.records import read_regular

TRASH_DAYS = 30
"""Time after which deleted items are removed from the trash, in days. A class has its next lessons
within this time, and would notice a wrong deletion."""
AGES = ".trash-days"
"""Name of the file with the age of each item in the trash, in days."""
_MOST_DAYS = 7.0
"""Maximum time that is added between two checks, in days. A class has a lesson each week."""
_DAY_S = 86_400.0


def remove_old(storage: Storage, now_s: float) -> None:
    """Remove items that have been in the trash for `TRASH_DAYS`. Never raises OSError.

    Args:
        now_s: The computer's clock, in seconds since 1970.
    """
    file, today = storage.root / AGES, now_s / _DAY_S
    try:
        saved = json.loads(read_regular(file, 1 << 20))
        latest = float(saved["latest"])
        ages = {str(key): float(days) for key, days in saved["days"].items()}
    except (OSError, *UNREADABLE):
        latest, ages = today, {}
    passed = min(max(0.0, today - latest), _MOST_DAYS)
    ages = {key: ages[key] + passed if key in ages else 0.0 for key in storage.deleted()}
    for key in [key for key, days in ages.items() if days > TRASH_DAYS]:
        shutil.rmtree(storage.trash / key, ignore_errors=True)
        del ages[key]
    if ages:
        with contextlib.suppress(OSError):
            write_whole(file, json.dumps({"latest": max(latest, today), "days": ages}).encode())
