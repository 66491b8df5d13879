"""The verbs `import` and `export` of `drivelesson episodes`."""

from __future__ import annotations

import argparse
import contextlib
import re
import shutil
from array import array
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from robot.errors import ConfigurationError, RecordingError, told_as
from robot.exchange.columns import NAMES as MEANINGS
from robot.exchange.drive import ImportReport, write_episode
from robot.exchange.files import check_suffix
from robot.exchange.film import SUFFIXES, write_look
from robot.exchange.folder import write_folder
from robot.exchange.lerobot import FPS, write_lerobot
from robot.exchange.npz import is_example, write_npz
from robot.exchange.own import SOURCE as OWN
from robot.exchange.reading import DEFAULT_THRESHOLD, Reading, parse_columns, parse_moves
from robot.exchange.sources import Source, find_drives, unpacked
from robot.exchange.timeline import make_timeline
from robot.exchange.tub import write_tub
from robot.recordings.editing import EpisodeFrame, moments
from robot.recordings.free_path import free_path
from robot.recordings.reading import reading
from robot.recordings.store import EpisodeStore
from robot.recordings.teaching import EditedEpisode
from robot.store.folder import Storage, check_name
from server.cli.parser import progress, whole
from server.recordings.selection import EPISODE_HELP, EpisodeVerb, find_paths, open_all

EXPORTS: dict[str, tuple[Callable[..., int], str, tuple[str, ...]]] = {
    "tub": (write_tub, "records", ("taught_only",)),
    "lerobot": (write_lerobot, "LeRobot episodes", ("fps", "task", "plain")),
    "folder": (write_folder, "pictures", ()),
    "npz": (write_npz, "examples", ()),
    "film": (write_look, "pictures", ("fps",)),
}
"""The export formats. For each: the function that writes it, a noun for what the function counts,
and the options."""
FLAGS = {"fps": "--fps", "taught_only": "--all", "task": "--task", "plain": "--plain"}
TIMED: dict[str, Callable[[EpisodeFrame], bool]] = {
    "film": lambda _: True,
    "lerobot": lambda moment: not moment.is_deleted,
    "npz": is_example,
}
"""Export formats for which irregular timestamps are repaired. A format's function returns True
for each picture that it exports."""


def configure_export(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("episodes", nargs="+", metavar="EPISODE", help=EPISODE_HELP)
    add("--as", dest="form", required=True, choices=EXPORTS, help="the format")
    add("--out", type=Path, help="folder or file to create")
    add(
        "--fps",
        type=whole(1, 240),
        help="pictures a second of a film or dataset (default for a dataset: 20)",
    )
    text = "tub: also export pictures without a label"
    add("--all", dest="taught_only", action="store_const", const=False, help=text)
    add("--task", help="lerobot: the robot's task, as a sentence")
    text = (
        "lerobot: export only the features that LeRobot itself records, so that the result can be "
        "merged with a dataset that LeRobot recorded"
    )
    add("--plain", action="store_const", const=True, help=text)


def configure_import(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("path", type=Path, help="file, archive or folder to import")
    add("--name", help="name of the episode")
    text = "steering beyond this value, 0 to 1, counts as a turn (default: %(default)s)"
    add("--threshold", type=float, default=DEFAULT_THRESHOLD, help=text)
    text = "steering value at which the car drives straight (default: 0)"
    add("--trim", type=float, default=0.0, help=text)
    text = "steering value at full lock (default: 1)"
    add("--full-lock", type=float, default=1.0, help=text)
    text = "move of each class, such as free=forward,blocked=left; stop skips a class"
    add("--moves", type=parse_moves, default={}, help=text)
    text = "which column contains what, such as picture=1,steering=angle"
    add("--columns", type=partial(parse_columns, known=tuple(MEANINGS)), default={}, help=text)
    text = "ROS bags: topics of the camera and of the velocities, separated by a comma"
    add("--topics", help=text)
    text = "import nothing if any picture would be skipped"
    add("--strict", action="store_true", help=text)


def import_episode(args: argparse.Namespace, store: EpisodeStore, storage: Storage) -> None:
    """Import the drives of another program, each as an episode; after an error, none is left."""
    reading = Reading(
        threshold=args.threshold,
        trim=args.trim,
        full_lock=args.full_lock,
        moves=args.moves,
        columns=args.columns,
        topics=tuple(name.strip() for name in (args.topics or "").split(",") if name.strip()),
    )
    if args.name:
        check_name(args.name)
    storage.sweep()  # remove unfinished files of an import that was killed
    whole = ImportReport(is_strict=args.strict)
    made: list[Path] = []
    try:
        with unpacked(args.path, storage.trash, whole) as path:
            sources = find_drives(path)
            for source in sources:
                try:
                    made.append(_import_one(source, reading, args, store))
                except RecordingError as error:
                    if len(sources) == 1:
                        raise
                    whole.skip(source.name, str(error))
        if not made:
            raise RecordingError(f"found no drive to import in {args.path}{whole.why_nothing()}")
    except BaseException:
        for each in made:
            each.unlink(missing_ok=True)
        raise
    for line in whole.lines():
        print(line)


def _import_one(
    source: Source, reading: Reading, args: argparse.Namespace, store: EpisodeStore
) -> Path:
    report = ImportReport(is_strict=args.strict)
    if source.copy:
        with store.new_file(args.name or _tidy(Path(source.name).stem)) as path:
            _tell(path, source.copy(path, report), source.name, OWN, report)
        return path
    drive = source.read(reading, report)
    showing = progress(None, "picture", "episodes", "episodes")
    with store.new_file(args.name or _tidy(drive.name)) as path, showing as bar:
        count = write_episode(drive, path, on_shot=bar.update)
    _tell(path, count, source.name, drive.source, drive.report)
    return path


def _tell(path: Path, count: int, name: str, form: str, report: ImportReport) -> None:
    """Print what was imported: pictures, their rate, examples by label, and what was left out."""
    print(f"{path.stem}: {count} pictures from {name} ({form}), {report.rate:.3g} a second")
    labels = ", ".join(f"{move} {number}" for move, number in report.labels.most_common())
    print(f"  examples: {labels or 'none'}")
    for line in report.lines():
        print(f"  {line}")


def _tidy(name: str) -> str:
    """Turn the name of a folder into a valid name of an episode."""
    try:
        return check_name(re.sub(r"[^\w .()+,-]", "-", name).strip("-_ .")[:64])
    except ConfigurationError:
        return "import"


def export_episodes(args: argparse.Namespace, store: EpisodeStore, storage: Storage) -> None:
    paths = find_paths(store, args.episodes)
    if len(paths) > 1 and args.form != "lerobot":
        raise ConfigurationError(f"--as {args.form} exports one episode at a time")
    _, _, takes = EXPORTS[args.form]
    options = {n: value for n in FLAGS if (value := getattr(args, n)) not in (None, "")}
    if strange := [FLAGS[name] for name in options if name not in takes]:
        raise ConfigurationError(f"--as {args.form} does not use {', '.join(strange)}; omit it")
    out = args.out or _default_path(storage.exports, paths[0].stem, args.form)
    if args.form == "film":
        check_suffix(out, "a film", SUFFIXES)
    elif args.form == "npz":
        check_suffix(out, "an npz file", (".npz",))
    if out.exists():
        raise ConfigurationError(f"{out} exists already; choose another with --out")
    with reading(paths):
        _export(args.form, open_all(paths), out, options, args.fps)


def _export(
    form: str, episodes: list[EditedEpisode], out: Path, options: dict[str, Any], fps: int | None
) -> None:
    write, what, _ = EXPORTS[form]
    given = [episodes] if form == "lerobot" else episodes[0]
    total = sum(len(episode.frames) for episode, _ in episodes)
    refusing = told_as(ConfigurationError, f"cannot write {out}")
    showing = progress(total, "picture", "episodes", "episodes")
    with refusing, showing as bar, _beside(out) as part:
        for episode, _ in episodes:
            episode.on_read = bar.update
        made = write(*given, part, **options)
        bar.update(total - bar.n)  # count the pictures that were left out, so that the bar is full
    print(f"{out}: {made} {what}")
    sizes = set[tuple[int, int]]().union(*(episode.frames.sizes for episode, _ in episodes))
    if len(sizes) > 1 and form in ("film", "lerobot"):
        print(f"  pictures of {len(sizes)} sizes were scaled to the size of the first")
    for episode, notes in episodes if form in TIMED else ():
        shown = filter(TIMED[form], moments(episode, notes, about=()))
        times_s = array("d", (moment.at_s for moment in shown))
        line = make_timeline(times_s)
        if line.remark:
            print(f"  {episode.id}: {line.remark}")
        if form == "lerobot" and line.fps != (rate := fps or FPS):
            print(
                f"  {episode.id}: {line.fps} pictures a second became {rate}; "
                "--fps chooses another rate"
            )


@contextlib.contextmanager
def _beside(path: Path) -> Iterator[Path]:
    """Yield a path to write to; it is renamed to `path` at the end, or removed after an error."""
    folder = path.with_name(f".part-{path.name}")
    shutil.rmtree(folder, ignore_errors=True)  # remove the files of an export that was killed
    try:
        folder.mkdir(parents=True)
        yield folder / path.name
        (folder / path.name).rename(path)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _default_path(folder: Path, episode_id: str, form: str) -> Path:
    ending = {"film": ".mp4", "npz": ".npz"}.get(form, "")
    return free_path(folder, re.sub(r"\s+", "-", f"{episode_id}-{form}"), ending)


EXPORT = EpisodeVerb("export recordings for other programs", configure_export, export_episodes)
IMPORT = EpisodeVerb(
    "import recordings of other programs: tubs, LeRobot, ROS bags, OpenBot, tables, pictures",
    configure_import,
    import_episode,
    changes=True,
    may_create=True,
)
