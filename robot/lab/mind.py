"""A changed mind: LEFT at walls for a minute, then RIGHT. How soon does it turn right?"""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence

from robot.lab.experiment import Experiment, ExperimentSettings, Runs, group
from robot.lab.tables import percent
from robot.lab.task import Task
from robot.store.table import Cell, Table

WORLDS = ("box", "office", "clutter")
LEARNERS = ("default-32", "without-forgetting-32")
FIRST_SEED = 900
NEVER_LEFT = ", never taught left"


def _plan(settings: ExperimentSettings) -> Iterator[Task]:
    """Plan every learner in every place, at 10 and 30 frames a second in turn."""
    learners = settings.learners or LEARNERS
    for learner, old_s in (*((name, 60.0) for name in learners), (learners[0], 0.0)):
        for world in WORLDS[:1] if settings.quick else WORLDS:
            for seed in range(1 if settings.quick else max(2, settings.n_seeds)):
                params = {
                    "world": world,
                    "learner": learner,
                    "seed": FIRST_SEED + seed,
                    "rate_hz": (10.0, 30.0)[seed % 2],
                    "old_s": old_s,
                    "new_s": 30.0,
                    "asked_s": 40.0,
                    "alone_s": 60.0,
                }
                yield Task("mind", params)


def _tables(runs: Runs) -> list[Table]:
    rows: list[tuple[Cell, ...]] = []
    for (learner, old_s), results in group(runs, "learner", "old_s").items():
        name = f"{learner}{'' if old_s else NEVER_LEFT}"
        for phase, seconds in (("first", 30), ("second", 60)):
            views = [result[phase] for result in results]
            shares = [each["right"] / each["blocked"] for each in views if each["blocked"]]
            own_turns = None
            if phase == "second":
                own_turns = _share([result["alone"] for result in results], "right", "turns")
            rows.append(
                (
                    f"{name}, after {seconds} s",
                    len(shares),
                    percent(statistics.median(shares)),
                    percent(statistics.fmean(shares)),
                    percent(min(shares)),
                    _share(views, "left", "blocked"),
                    _share(views, "turning_right", "turning"),
                    own_turns,
                )
            )
    columns = ("", "runs", "right, median", "mean", "least", "left", "of all", "own turns")
    return [Table(title="Where the pilot turns right", columns=columns, rows=tuple(rows))]


def _share(counts: Sequence[dict[str, int]], part: str, whole: str) -> str:
    total = sum(count[whole] for count in counts)
    return percent(sum(count[part] for count in counts) / max(total, 1))


MIND = Experiment(
    name="mind",
    title="A changed mind",
    text="A minute of a pilot who turns left alone, then half a minute of one who turns right "
    "alone, and again half a minute; after each the robot is asked, without learning, what it "
    "would do where that pilot turns right. 'right': share of those views with less than "
    "22 cm of free way on which it would turn right. 'of all': of all views on which the "
    "pilot turns; towards the end of a turn the same view means both. 'own turns': of its "
    "turns in a minute alone, afterwards, those to the right. The rows 'never taught left' "
    "are what can be had at all.",
    plan=_plan,
    tables=_tables,
)
