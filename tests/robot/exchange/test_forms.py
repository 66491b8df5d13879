"""Every form of data that people have comes in right, or is refused by a true sentence."""

from __future__ import annotations

import os
import random
import shutil
from pathlib import Path

import pytest

from robot.exchange.drive import ImportReport, write_episode
from robot.exchange.reading import Reading
from robot.exchange.sources import find_drives, unpacked
from robot.recordings.episode import open_episode

from .labels import taught_labels
from .made import MAKERS, Made, number_of

VARIANTS = int(os.environ.get("DRIVELESSON_FORMS", "6"))


def came_in(made: Made, home: Path, report: ImportReport) -> dict[int, str | None]:
    """Import what was made; return the label of each picture that came in."""
    target = home / "got.mcap"
    with unpacked(made.path, home, report) as path:
        [source] = find_drives(path)
        write_episode(source.read(Reading(**made.reading), report), target)
    episode = open_episode(target)
    labels = taught_labels(episode)
    times_s = [entry.captured_s for entry in episode.frames.values()]
    assert times_s == sorted(set(times_s))
    return {number_of(episode.frame(i)): labels.get(i) for i in episode.frames}


@pytest.mark.parametrize("form", MAKERS)
def test_each_variant_of_a_form_comes_in_right(form: str, tmp_path: Path) -> None:
    wrong = []
    for seed in range(VARIANTS):
        home = tmp_path / str(seed)
        home.mkdir()
        made = MAKERS[form](random.Random(f"{form} {seed}"), home)
        report = ImportReport()
        found = came_in(made, home, report)
        true = {number: label for number, label in made.truth.items() if number not in made.damaged}
        if found != true:
            wrong.append((seed, found, true, report.lines()))
        shutil.rmtree(home)
    print(f"{form}: {VARIANTS} variants, {len(wrong)} wrong")
    assert not wrong
