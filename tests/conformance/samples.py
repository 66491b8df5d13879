"""Writes one simulated drive in every format for the other programs, and imports their data."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

from robot.exchange.drive import ImportReport, write_episode
from robot.exchange.film import write_look
from robot.exchange.lerobot import write_lerobot
from robot.exchange.reading import Reading
from robot.exchange.sources import find_drives
from robot.exchange.tub import write_tub
from robot.recordings.edits import Notes
from robot.recordings.episode import open_episode, taught_frames
from server.integrations.extension import IntegrationsExtension
from server.integrations.metrics import render_metrics
from tests.robot.exchange.sim_drive import drive_in_simulator
from tests.server.virtual import ServedWorld, virtually


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples:
    """Write one drive as a recording, a tub, a dataset of two episodes and a film; write another
    lesson as a dataset and as a plain dataset; and write the text of `/metrics`."""

    recording: Path
    lesson: Path
    tub: Path
    lerobot: Path
    other: Path
    plain: Path
    film: Path
    metrics: str


def make_samples(folder: Path) -> Samples:
    """Drive in the simulator, and export."""
    recording = drive_in_simulator(folder, "default-8").path
    episode, notes = open_episode(recording), Notes()
    home = folder / "second"
    home.mkdir()
    lesson = drive_in_simulator(home, "default-8", steps=60).path
    made = Samples(
        recording=recording,
        lesson=lesson,
        tub=folder / "tub",
        lerobot=folder / "lerobot",
        other=folder / "other",
        plain=folder / "plain",
        film=folder / "film.mp4",
        metrics=metrics_of_a_robot(),
    )
    write_tub(episode, notes, made.tub)
    write_lerobot([(episode, notes), (episode, notes)], made.lerobot)
    write_look(episode, notes, made.film)
    write_lerobot([(open_episode(lesson), notes)], made.other)
    write_lerobot([(open_episode(lesson), notes)], made.plain, plain=True)
    return made


def metrics_of_a_robot() -> str:
    """Return the text of `/metrics`, from a robot that has all metrics."""

    async def scenario(world: ServedWorld) -> str:
        pilot = await world.pilot(sees=True)
        pilot.mode("train")
        pilot.hold("forward")
        await world.forward(1.0)
        world.services.gateway.refused["rate"] += 1
        ages = world.services.extension(IntegrationsExtension).frame_ages
        return render_metrics(world.services, ages).decode()

    return virtually(scenario)


def imports_of(*folders: Path) -> str:
    """Import everything in some folders, strictly; return the numbers of imports."""
    frames = examples = 0
    with tempfile.TemporaryDirectory() as scratch:
        found = (source for folder in folders for source in find_drives(folder))
        for number, source in enumerate(found):
            path = Path(scratch) / f"{number}.mcap"
            frames += write_episode(source.read(Reading(), ImportReport(is_strict=True)), path)
            examples += len(taught_frames(open_episode(path)))
    return f"{frames} pictures, {examples} examples"
